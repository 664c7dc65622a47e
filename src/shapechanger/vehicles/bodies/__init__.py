"""Vehicles: models of a car, a tank, a truck and a boat with their motors and servos."""

from __future__ import annotations

from shapechanger.vehicles.bodies.fleet import (
    SIM_DT,
    VEHICLES,
    add_vehicle,
    require_fit,
    vehicle_model,
)
from shapechanger.vehicles.bodies.model import BoundVehicle, Motion, Outputs, VehicleModel

__all__ = [
    "SIM_DT",
    "VEHICLES",
    "BoundVehicle",
    "Motion",
    "Outputs",
    "VehicleModel",
    "add_vehicle",
    "require_fit",
    "vehicle_model",
]
