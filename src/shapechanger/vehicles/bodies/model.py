"""Vehicles in a running simulation: all vehicles, land vehicles, and contacts."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.vehicles.bodies.parts import DcMotor

Outputs = Mapping[str, float | None]
"""Output of each part, from -1 to 1, or None.

An output of a motor is a share of the battery's voltage; an output of a servo is a share of its
travel, negative to the left. None disconnects a motor, and lets a servo keep its last angle.
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


class BoundVehicle(ABC):
    """A vehicle in a running simulation. Its origin is on the ground below its middle.

    Args:
        model: Compiled model with the vehicle.
        data: State of the model.
        motor: Motor of each tendon; a tendon is named "vehicle/" plus the part that it drives.
        full_lock: Angle of the front wheels or the rudder at a steering of 1, rad.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, motor: DcMotor, full_lock: float = 0.0
    ) -> None:
        self._model, self._data, self._motor, self._full_lock = model, data, motor, full_lock
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        self._rates = data.ten_velocity  # Speeds of the shafts, rad/s.
        # Actuator and tendon of each driven part, and the parts that are disconnected.
        self._shafts = {
            model.tendon(i).name.removeprefix("vehicle/"): (
                int(model.actuator(model.tendon(i).name).id),
                i,
            )
            for i in range(model.ntendon)
        }
        self._open = frozenset[str]()
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
        """Apply the outputs, and the forces of the water to a boat; call this every 10 ms."""
        self._open = frozenset([part for part in self._shafts if outputs.get(part, 0.0) is None])
        for part, (actuator, tendon) in self._shafts.items():
            value = outputs.get(part, 0.0)
            self._ctrl[actuator] = (
                self._motor.volts_per_speed * self._rates[tendon]
                if value is None
                else min(1.0, max(-1.0, value)) * battery_v
            )

    @abstractmethod
    def motion(self) -> Motion:
        """Current pose and velocity."""

    @abstractmethod
    def travelled_m(self) -> float:
        """Distance rolled, or moved through the water by a boat, since `place`, m."""

    def current_a(self) -> float:
        """Current of the motors, A, >= 0; a braking motor draws none."""
        total_a = 0.0
        for part, (actuator, tendon) in self._shafts.items():
            if part not in self._open:
                volts, rate = float(self._ctrl[actuator]), float(self._rates[tendon])
                total_a += self._motor.amperes(volts, rate)
        return total_a

    def set_current(self, vx: float, vy: float) -> None:
        """Set the flow of the water, m/s; land vehicles ignore it, and `place` keeps it."""
        self._flow = (vx, vy)


class Rolling(BoundVehicle):
    """A vehicle on land."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, motor: DcMotor, full_lock: float
    ) -> None:
        super().__init__(model, data, motor, full_lock)
        root = model.joint("vehicle/chassis")
        self._qpos0, self._qvel0 = int(root.qposadr[0]), int(root.dofadr[0])
        geoms = map(model.geom, range(model.ngeom))
        self._radius = next(float(geom.size[0]) for geom in geoms if geom.name.endswith(" wheel"))
        self._steering = 0.0
        if full_lock:
            self._servos = [model.actuator(f"vehicle/{n} steering").id for n in ("left", "right")]
            knuckle, rear = map(model.body, ("vehicle/left knuckle", "vehicle/rear left wheel"))
            self._wheelbase = float(knuckle.pos[0] - rear.pos[0])
            self._half_gauge = float(knuckle.pos[1])

    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        self._steering = 0.0
        p, v = self._qpos0, self._qvel0
        half = heading / 2
        self._qpos[p : p + 7] = (x, y, 0.0, math.cos(half), 0.0, 0.0, math.sin(half))
        self._qvel[v : v + 6] = 0.0

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the voltages of the motors and the angles of the front wheels.

        All wheels roll around one point on the line of the rear axle (Ackermann's condition).
        """
        super().drive(outputs, battery_v)
        steering = outputs.get("steering", 0.0)
        if not self._full_lock or steering is None or steering == self._steering:
            return
        self._steering = steering
        angle = -min(1.0, max(-1.0, steering)) * self._full_lock
        curvature = math.tan(angle) / self._wheelbase
        along, half = self._wheelbase * curvature, curvature * self._half_gauge
        for servo, shorter in zip(self._servos, (half, -half), strict=True):
            self._ctrl[servo] = math.atan(along / (1.0 - shorter))

    def motion(self) -> Motion:
        """Current pose and velocity."""
        p, v = self._qpos0, self._qvel0
        x, y, _, qw, qx, qy, qz = self._qpos[p : p + 7].tolist()
        vx, vy, _, _, _, yaw_rate = self._qvel[v : v + 6].tolist()
        heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        cosine, sine = math.cos(heading), math.sin(heading)
        return Motion(x, y, heading, vx * cosine + vy * sine, vy * cosine - vx * sine, yaw_rate)

    def travelled_m(self) -> float:
        """Mean distance that the driven wheels rolled since `place`, m."""
        # Each tendon measures the angle of one shaft, rad.
        return self._radius * sum(self._data.ten_length.tolist()) / len(self._shafts)


BUMPER_SPREAD: Final = math.radians(60.0)
"""Largest bearing, rad, from the middle of the vehicle, at which a contact presses the bumper."""

APART_S: Final = 0.5
"""Longest time between two contacts of the same collision, s."""


class ContactTracker:
    """Tracks contacts of a vehicle with walls and obstacles.

    Args:
        model: Compiled model. Geoms of the vehicle are named "vehicle/...", walls "world/wall..."
            and obstacles "world/thing...".

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
        """Update from the contacts after `dt_s` seconds of simulation."""
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
