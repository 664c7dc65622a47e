"""Vehicles: models of a car, a tank, a truck and a boat with their motors and servos."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import mujoco

from shapechanger.errors import ProfileError, UnknownName
from shapechanger.vehicles.bodies.boat import BOAT
from shapechanger.vehicles.bodies.land import CAR, TANK, TRUCK
from shapechanger.vehicles.bodies.model import BoundVehicle, Motion, Outputs, VehicleModel
from shapechanger.vehicles.bodies.parts import HOBBY_SERVO, aim_camera
from shapechanger.vehicles.bodies.visuals import dress

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

SIM_DT: Final = 0.005
"""Simulation step, s, at which all vehicles are stable."""

_MODELS: Final = Path(__file__).parent / "models"

VEHICLES: Final[Mapping[str, VehicleModel]] = MappingProxyType(
    {model.name: model for model in (CAR, TANK, TRUCK, BOAT)}
)
"""Vehicle models, keyed by name."""


def vehicle_model(name: str) -> VehicleModel:
    """Find a vehicle model by name."""
    if name not in VEHICLES:
        raise UnknownName("vehicle", name, VEHICLES)
    return VEHICLES[name]


def add_vehicle(
    spec: mujoco.MjSpec, name: str, light: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> VehicleModel:
    """Add a vehicle at the origin of a model, and set the step and solver options that it needs.

    Names of its elements start with "vehicle/". `light` is the red, green and blue of the light on
    it, each 0 to 1, for views from outside.
    """
    model = vehicle_model(name)
    vehicle = mujoco.MjSpec.from_file(str(_MODELS / f"{name}.xml"))
    model.motor.add(vehicle)
    HOBBY_SERVO.add(vehicle)
    dress(vehicle, name, light)
    aim_camera(vehicle.body("chassis").add_camera(name="camera"), model.camera)
    spec.attach(vehicle, prefix="vehicle/", frame=spec.worldbody.add_frame())
    spec.option.timestep = SIM_DT
    # Back EMF and servos act as damping, which this integrator treats implicitly.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # The elliptic cone lets wheels slip equally in all directions; the impedance ratio keeps a
    # vehicle at rest from creeping.
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    # Poses of what never moves are then computed once, not in each step. The vehicle itself never
    # sleeps, so that its motion is the same.
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    return model


def require_fit(name: str, parts: Collection[str]) -> None:
    """Check that a robot's parts fit a vehicle."""
    model = vehicle_model(name)
    driving = frozenset(parts) - model.optional_parts
    if driving not in model.drives:
        chosen, *choices = (
            " and ".join(map(repr, sorted(drive))) for drive in (driving, *model.drives)
        )
        raise ProfileError(
            f"The robot drives {chosen or 'nothing'}; a {name} is driven by "
            f"{', or by '.join(choices)}."
        )
