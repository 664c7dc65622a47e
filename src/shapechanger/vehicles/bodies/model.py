"""Interfaces of a vehicle: its model, the vehicle in a running simulation, and its contacts."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.vehicles.bodies.parts import CameraMount, DcMotor

Outputs = Mapping[str, float | None]
"""Output of each part, from -1 to 1; None for a motor that is disconnected.

For a motor it is a share of the battery's voltage, for a servo a share of its travel. Steering
and rudder are negative to the left. A servo without pulses, None, keeps its last angle.
"""


class Motion(NamedTuple):
    """Pose of a vehicle seen from above, and its velocity.

    Attributes:
        x: Position, m.
        y: Position, m.
        heading: Angle from the x axis, rad, counter-clockwise.
        speed: Speed along the heading, m/s; backward is negative.
        lateral_speed: Speed to the left, m/s.
        yaw_rate: Rate of turn, rad/s, counter-clockwise seen from above.
    """

    x: float
    y: float
    heading: float
    speed: float
    lateral_speed: float
    yaw_rate: float


class MotorDrive:
    """A motor in a running simulation, which turns the joints of a tendon."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, name: str, motor: DcMotor
    ) -> None:
        self._motor, self._ctrl = motor, data.ctrl
        self._velocity = data.ten_velocity
        self._actuator, self._tendon = int(model.actuator(name).id), int(model.tendon(name).id)
        self._is_open = False

    def set(self, value: float | None, battery_v: float) -> None:
        """Set a share of the battery's voltage, -1 to 1; None disconnects the motor."""
        self._is_open = value is None
        self._ctrl[self._actuator] = (
            self._motor.volts_per_speed * self._velocity[self._tendon]
            if value is None
            else min(1.0, max(-1.0, value)) * battery_v
        )

    def current_a(self) -> float:
        """Current from the battery, A."""
        if self._is_open:
            return 0.0
        speed = float(self._velocity[self._tendon])
        return self._motor.amperes(float(self._ctrl[self._actuator]), speed)

    def rate(self) -> float:
        """Speed of the shaft, rad/s."""
        return float(self._velocity[self._tendon])


class BoundVehicle(ABC):
    """A vehicle in a running simulation. Its origin is on the ground below its middle.

    Args:
        model: Compiled model with the vehicle.
        data: Its state.
        motor: Motor of each tendon; a tendon is named "vehicle/" plus the part that it drives.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, motor: DcMotor) -> None:
        self._model = model
        self._data = data
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        tendons = (model.tendon(i).name for i in range(model.ntendon))
        self._drives = {
            name.removeprefix("vehicle/"): MotorDrive(model, data, name, motor) for name in tendons
        }
        self._flow = (0.0, 0.0)
        # Addresses in qpos and qvel of the joints of wheels, rudders and trailers.
        self._joints = [
            (int(joint.qposadr[0]), int(joint.dofadr[0]))
            for joint in map(model.joint, range(model.njnt))
            if joint.name.startswith("vehicle/") and not joint.name.startswith("vehicle/chassis")
        ]

    @abstractmethod
    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        """Set position and velocity of the chassis; see `place`."""

    def place(self, x: float, y: float, heading: float) -> None:
        """Put the vehicle at a pose, m and rad, at rest and with straight wheels."""
        self._place_chassis(x, y, heading)
        for qpos, qvel in self._joints:
            self._qpos[qpos] = 0.0
            self._qvel[qvel] = 0.0
        self._ctrl[:] = 0.0
        self._data.qfrc_applied[:] = 0.0
        self._data.qacc_warmstart[:] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Apply outputs and, to a boat, the forces of the water; call it every 10 ms."""
        for part, drive in self._drives.items():
            drive.set(outputs.get(part, 0.0), battery_v)

    @abstractmethod
    def motion(self) -> Motion:
        """Current pose and velocity."""

    @abstractmethod
    def travelled_m(self) -> float:
        """Distance that the wheels rolled since `place`, or that a boat moved through the water."""

    def current_a(self) -> float:
        """Current of the motors, A, >= 0; a braking motor draws none."""
        total_a = 0.0
        for drive in self._drives.values():
            total_a += drive.current_a()
        return total_a

    def set_current(self, vx: float, vy: float) -> None:
        """Set the flow of the water, m/s; land vehicles ignore it, and `place` keeps it."""
        self._flow = (vx, vy)


@dataclass(frozen=True, slots=True, kw_only=True)
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
        top_speed_mps: Speed at full throttle and `BATTERY_V`, on level ground or in still water.
        turning_radius_m: Radius of the origin's path at full lock; 0 if it turns on the spot.
        motor: Motor of each of its driving parts.
        bind: Finds its joints and motors in a compiled model.
    """

    name: str
    drives: tuple[frozenset[str], ...]
    optional_parts: frozenset[str] = frozenset()
    length_m: float
    width_m: float
    nose_m: float
    floats: bool = False
    camera: CameraMount
    top_speed_mps: float
    turning_radius_m: float
    motor: DcMotor
    bind: Callable[[mujoco.MjModel, mujoco.MjData], BoundVehicle]

    @property
    def parts(self) -> frozenset[str]:
        """All parts that have an effect."""
        return frozenset[str]().union(*self.drives)


BUMPER_SPREAD: Final = math.radians(60.0)
"""Largest bearing, rad, from the middle of the vehicle, at which a contact presses the bumper."""

APART_S: Final = 0.5
"""Contacts that follow one another within this time, s, belong to the same collision."""


class ContactTracker:
    """Tracks contacts of a vehicle with walls and obstacles.

    Args:
        model: Model whose vehicle geoms are named "vehicle/...", and its walls and obstacles
            "world/wall/..." and "world/thing/...".

    Attributes:
        collisions: Number of collisions since `reset`.
        bumped: Whether a contact presses the front bumper.
        touches: Whether there is any contact.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        names = [model.geom(i).name for i in range(model.ngeom)]
        self._hull = np.array([name.startswith("vehicle/") for name in names])
        self._solid = np.array([name.startswith(("world/wall", "world/thing")) for name in names])
        self._solid_ids = frozenset(np.flatnonzero(self._solid).tolist())
        self.reset()

    def reset(self) -> None:
        """Forget all contacts and collisions."""
        self.collisions = 0
        self.release()

    def release(self) -> None:
        """Forget the current contacts, so that the next one is a new collision."""
        self.bumped = self.touches = False
        self._since_s = math.inf

    def follow(self, data: mujoco.MjData, motion: Motion, dt_s: float) -> None:
        """Update from the contacts of a simulation step of this length, s."""
        self._since_s += dt_s
        self.bumped = self.touches = False
        if data.ncon == 0:
            return
        pairs = data.contact.geom
        if self._solid_ids.isdisjoint(pairs.ravel().tolist()):
            return  # Usual case: only the wheels touch the ground.
        first, second = pairs[:, 0], pairs[:, 1]
        hits = (self._hull[first] & self._solid[second]) | (self._hull[second] & self._solid[first])
        hits &= data.contact.dist <= 0.0
        if not hits.any():
            return
        self.touches = True
        if self._since_s > APART_S:
            self.collisions += 1
        self._since_s = 0.0
        for x, y, _ in data.contact.pos[hits]:
            bearing = math.atan2(y - motion.y, x - motion.x) - motion.heading
            self.bumped |= abs(math.remainder(bearing, math.tau)) <= BUMPER_SPREAD
