"""Interfaces of a vehicle: its model, and the vehicle in a running simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import mujoco

Outputs = Mapping[str, float | None]
"""Output of each part, from -1 to 1; None for a motor that is disconnected.

For a motor it is a share of the battery's voltage, for a servo a share of its travel. Steering
and rudder are negative to the left. A servo without pulses, None, keeps its last angle.
"""


class PlanarPose(NamedTuple):
    """Pose of a vehicle seen from above.

    Attributes:
        x: Position, m.
        y: Position, m.
        heading: Angle from the x axis, rad, counter-clockwise.
    """

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class CameraMount:
    """Pose and field of view of a vehicle's camera.

    Attributes:
        x: Position ahead of the vehicle's origin, m.
        y: Position to the left of it, m.
        z: Height above the ground, m.
        pitch_rad: Angle of the optical axis below the horizon.
        fovy_deg: Vertical field of view.
    """

    x: float
    y: float
    z: float
    pitch_rad: float
    fovy_deg: float


class BoundVehicle(Protocol):
    """A vehicle in a running simulation. Its origin is on the ground below its middle."""

    def place(self, x: float, y: float, heading: float) -> None:
        """Put the vehicle at a pose, at rest and with straight wheels.

        Args:
            x: Position, m.
            y: Position, m.
            heading: Angle from the x axis, rad, counter-clockwise.
        """
        ...

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Apply outputs and, to a boat, the forces of the water; call it every 10 ms.

        Args:
            outputs: Output of each part; 0 for those that are missing.
            battery_v: Voltage of the battery under load.
        """
        ...

    def pose(self) -> PlanarPose:
        """Current pose."""
        ...

    def speed(self) -> float:
        """Speed along the heading, m/s; backward is negative."""
        ...

    def lateral_speed(self) -> float:
        """Speed to the left, m/s."""
        ...

    def yaw_rate(self) -> float:
        """Rate of turn, rad/s, counter-clockwise seen from above."""
        ...

    def travelled_m(self) -> float:
        """Distance that the wheels rolled since `place`, or that a boat moved through the water."""
        ...

    def current_a(self) -> float:
        """Current of the motors, A, >= 0; a braking motor draws none."""
        ...

    def set_current(self, vx: float, vy: float) -> None:
        """Set the flow of the water; land vehicles ignore it, and `place` keeps it.

        Args:
            vx: Flow along the world's x axis, m/s.
            vy: Flow along the world's y axis, m/s.
        """
        ...


@dataclass(frozen=True, slots=True)
class VehicleModel:
    """A kind of vehicle.

    Attributes:
        name: Name, such as "car".
        drives: Alternative sets of parts that drive and steer it; a robot has exactly one set.
        optional_parts: Further parts that a robot may have; they have no effect in simulation.
        length_m: Length from bumper to bumper, trailer included.
        width_m: Largest width.
        nose_m: Distance from the origin to the front bumper.
        floats: Whether it moves on water.
        camera: Mount of its camera.
        battery_v: Battery voltage at which `top_speed_mps` holds.
        top_speed_mps: Speed on level ground, or in still water, at full throttle.
        turning_radius_m: Radius of the origin's path at full lock; 0 if it turns on the spot.
        build: Adds its body, joints and motors to a model.
        bind: Finds them in the compiled model.
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
        """All parts that have an effect."""
        return frozenset[str]().union(*self.drives)
