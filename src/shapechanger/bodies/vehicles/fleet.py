"""The vehicles by name, and how one gets into a model."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Final

import mujoco

from shapechanger.bodies.vehicles.boat import BOAT
from shapechanger.bodies.vehicles.car import CAR
from shapechanger.bodies.vehicles.model import VehicleModel
from shapechanger.bodies.vehicles.tank import TANK
from shapechanger.bodies.vehicles.truck import TRUCK
from shapechanger.errors import ProfileError, UnknownName

__all__ = ["SIM_DT", "VEHICLES", "add_vehicle", "require_fit", "vehicle_model"]

SIM_DT: Final = 0.005
"""Step of the simulation, s, at which all of them run stably."""

VEHICLES: Final[Mapping[str, VehicleModel]] = MappingProxyType(
    {model.name: model for model in (CAR, TANK, TRUCK, BOAT)}
)
"""Every vehicle by its name."""


def vehicle_model(name: str) -> VehicleModel:
    """The vehicle of this name.

    Raises:
        UnknownName: If there is none.
    """
    if name not in VEHICLES:
        raise UnknownName("vehicle", name, VEHICLES)
    return VEHICLES[name]


def add_vehicle(spec: mujoco.MjSpec, name: str) -> VehicleModel:
    """Add a vehicle to a model, at its origin, and set the step and the solver that it needs.

    Raises:
        UnknownName: If no vehicle has this name.
    """
    model = vehicle_model(name)
    spec.option.timestep = SIM_DT
    # Back EMF and servos act as damping, which this integrator takes in implicitly.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # A cone that is round lets wheels slip alike in every direction; the ratio keeps a vehicle
    # at rest from creeping.
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    model.build(spec)
    return model


def require_fit(name: str, parts: Collection[str]) -> None:
    """Let pass a robot whose parts fit the vehicle.

    Args:
        name: Of the vehicle.
        parts: What the robot's outputs turn, such as "wheels" and "steering".

    Raises:
        UnknownName: If no vehicle has this name.
        ProfileError: If a part is missing, or is none of the vehicle's; the message says which.
    """
    model = vehicle_model(name)
    given = frozenset(parts)
    foreign = given - model.parts - model.optional_parts
    if foreign:
        raise ProfileError(
            f"A {name} has no {_listed(foreign, 'or')}. It is driven by {_choices(model)}."
        )
    driving = given - model.optional_parts
    if driving not in model.drives:
        raise ProfileError(
            f"The robot drives {_listed(driving, 'and') or 'nothing'}; "
            f"a {name} is driven by {_choices(model)}."
        )


def _choices(model: VehicleModel) -> str:
    return ", or by ".join(_listed(drive, "and") for drive in model.drives)


def _listed(names: Collection[str], word: str) -> str:
    return f" {word} ".join(f"{name!r}" for name in sorted(names))
