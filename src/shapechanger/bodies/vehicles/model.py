"""What every vehicle is, before and after it is part of a simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import mujoco

from shapechanger.worlds.world import Pose

__all__ = ["BoundVehicle", "CameraMount", "Outputs", "VehicleModel"]

Outputs = Mapping[str, float | None]
"""Value of each part, from -1 to 1; None for a motor that nothing is connected to.

For a motor it is a share of the battery's voltage, for a servo a share of its travel. Steering
and rudder are negative to the left. A servo without pulses, None, stays where it was sent.
"""


@dataclass(frozen=True, slots=True)
class CameraMount:
    """Where the camera sits and what it sees.

    Attributes:
        x: Ahead of the vehicle's origin, m.
        y: To the left of it, m.
        z: Above the ground, m.
        pitch_rad: How far its axis points below the horizon.
        fovy_deg: Angle from the upper to the lower edge of its picture.
    """

    x: float
    y: float
    z: float
    pitch_rad: float
    fovy_deg: float


class BoundVehicle(Protocol):
    """A vehicle in a simulation that runs. Its origin is on the ground below its middle."""

    def place(self, x: float, y: float, heading: float) -> None:
        """Put it there at rest, its wheels straight. Lengths in m, the angle in rad."""
        ...

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the forces of its motors; to be called before every step of the simulation.

        Args:
            outputs: Value of each part. One that is missing is 0.
            battery_v: Voltage of the battery under load.
        """
        ...

    def pose(self) -> Pose:
        """Where it is."""
        ...

    def speed(self) -> float:
        """Along its heading, m/s; backward is negative."""
        ...

    def lateral_speed(self) -> float:
        """To its left, m/s."""
        ...

    def yaw_rate(self) -> float:
        """Counter-clockwise seen from above, rad/s."""
        ...

    def travelled_m(self) -> float:
        """What its wheels rolled since it was placed, or how far it went through the water."""
        ...

    def current_a(self) -> float:
        """What its motors draw, A; 0 or more. A motor that brakes draws nothing."""
        ...

    def set_current(self, vx: float, vy: float) -> None:
        """Let the water flow so from now on, m/s along the axes of the world.

        On land nothing happens. Placing the vehicle does not change it.
        """
        ...


@dataclass(frozen=True, slots=True)
class VehicleModel:
    """A kind of vehicle.

    Attributes:
        name: Such as "car".
        drives: Sets of parts of which a robot has one, whole: what drives and steers the vehicle.
        optional_parts: Parts that a robot may have besides; they do nothing here.
        length_m: From bumper to bumper, a trailer included.
        width_m: Over the widest part.
        nose_m: From the origin to the front of the bumper.
        floats: Whether it moves on water.
        camera: Where its camera sits.
        battery_v: Voltage that the sizes below are for.
        top_speed_mps: On even ground, or in still water, at full throttle and `battery_v`.
        turning_radius_m: Of the origin's path at full lock, or 0 for one that turns on the spot.
        build: Adds its body, joints and motors to a model.
        bind: Finds them again in the compiled model.
    """

    name: str
    drives: tuple[frozenset[str], ...]
    optional_parts: frozenset[str]
    length_m: float
    width_m: float
    nose_m: float
    floats: bool
    camera: CameraMount
    battery_v: float
    top_speed_mps: float
    turning_radius_m: float
    build: Callable[[mujoco.MjSpec], None]
    bind: Callable[[mujoco.MjModel, mujoco.MjData], BoundVehicle]

    @property
    def parts(self) -> frozenset[str]:
        """Every part that does something."""
        return frozenset[str]().union(*self.drives)
