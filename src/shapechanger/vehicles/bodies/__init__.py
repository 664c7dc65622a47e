"""Vehicles: models of a car, a tank, a truck and a boat with their motors and servos."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

import msgspec
import mujoco

from shapechanger.errors import ProfileError, require_known
from shapechanger.vehicles.bodies.model import BoundVehicle, Floating, Rolling
from shapechanger.vehicles.bodies.parts import (
    HOBBY_MOTOR,
    CameraMount,
    DcMotor,
    add_servo,
    aim_camera,
)
from shapechanger.vehicles.bodies.visuals import dress

SIM_DT: Final = 0.005
"""Simulation step, s, at which all vehicles are stable."""

_FOLDER: Final = Path(__file__).parent


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleModel:
    """A kind of vehicle."""

    name: str
    drives: tuple[frozenset[str], ...]  # Sets of driving parts; a robot has exactly one set.
    optional_parts: frozenset[str] = frozenset()  # Other parts; they are not simulated.
    length_m: float  # Length from bumper to bumper, including a trailer.
    width_m: float  # Largest width.
    nose_m: float  # Distance from the origin to the front bumper.
    floats: bool = False
    camera: CameraMount
    top_speed_mps: float  # Speed at full throttle and `BATTERY_V`, on level ground or still water.
    turning_radius_m: float  # Radius of the origin's path at full lock; 0 if it turns on the spot.
    gear: float  # Turns of `HOBBY_MOTOR` for each turn of the shaft that it drives.
    efficiency: float = 1.0  # Share of the torque that the gear transmits.
    # Angle at full steering of the rudder, or of a wheel in the middle of the front axle; 0 for a
    # vehicle without steering joints.
    lock_deg: float = 0.0

    @property
    def motor(self) -> DcMotor:
        """Motor, with its gear, of each driving part."""
        return HOBBY_MOTOR.geared(self.gear, self.efficiency)

    def bind(self, model: mujoco.MjModel, data: mujoco.MjData) -> BoundVehicle:
        """Return the vehicle in a simulation of `model` with the state `data`."""
        kind = Floating if self.floats else Rolling
        return kind(model, data, self.motor, math.radians(self.lock_deg))


VEHICLES: Final[Mapping[str, VehicleModel]] = MappingProxyType(
    {
        name: msgspec.convert({"name": name, **numbers}, VehicleModel)
        for name, numbers in tomllib.loads((_FOLDER / "vehicles.toml").read_text("utf-8")).items()
    }
)
"""Vehicle models, keyed by name."""


def vehicle_model(name: str) -> VehicleModel:
    """Find a vehicle model by name."""
    require_known("vehicle", VEHICLES, name)
    return VEHICLES[name]


def add_vehicle(
    spec: mujoco.MjSpec, name: str, light: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> VehicleModel:
    """Add a vehicle at the origin of a model, and set the step and solver options that it needs.

    Names of the vehicle's elements start with "vehicle/". `light` is the red, green and blue of the
    light on the vehicle in views from outside, each 0 to 1.
    """
    model = vehicle_model(name)
    vehicle = mujoco.MjSpec.from_file(str(_FOLDER / "models" / f"{name}.xml"))
    model.motor.add(vehicle)
    add_servo(vehicle)
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
    # With sleep, MuJoCo computes the poses of static bodies once instead of in each step. The
    # vehicle never sleeps, so its motion is the same.
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    return model


def require_fit(name: str, parts: Collection[str]) -> None:
    """Raise a `ProfileError` unless a robot's parts are exactly one drive of the vehicle."""
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
