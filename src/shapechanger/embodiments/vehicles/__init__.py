"""Vehicles: bodies, motors and servos of a car, a tank, a truck and a boat."""

from __future__ import annotations

from shapechanger.embodiments.vehicles.fleet import (
    SIM_DT,
    VEHICLES,
    add_vehicle,
    require_fit,
    vehicle_model,
)
from shapechanger.embodiments.vehicles.model import CameraMount, Outputs, Vehicle, VehicleModel

__all__ = [
    "SIM_DT",
    "VEHICLES",
    "CameraMount",
    "Outputs",
    "Vehicle",
    "VehicleModel",
    "add_vehicle",
    "require_fit",
    "vehicle_model",
]
