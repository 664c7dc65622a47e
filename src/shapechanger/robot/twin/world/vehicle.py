"""Vehicles in the plain room, moving in two dimensions, without slip except on water.

A vehicle turns the values of its outputs into speed ahead, speed to the left and rate of turn. Its
constants are typical of toys of 20 to 30 cm; none was measured.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.world import RESTING_V, Pose, Readings
from shapechanger.errors import RobotError
from shapechanger.robot.twin.world.room import FrontCamera, find_start, lay_out

Outputs = Mapping[str, float | None]

DEAD_BAND: Final = 0.04
"""Size of a value below which friction holds a motor."""

# Cars and trucks.
CAR_SPEED: Final = 1.5  # m/s at full throttle
CAR_LAG_S: Final = 0.15  # Time in which the speed covers 63 % of a difference.
WHEELBASE: Final = 0.18  # m
FULL_LOCK: Final = math.radians(28.0)  # Angle of the front wheels at a steering of 1.
STEERING_LAG_S: Final = 0.08

# Tanks and other vehicles that steer by two sides.
TRACK_SPEED: Final = 0.8  # m/s
TRACK_LAG_S: Final = 0.12
TRACK_GAUGE: Final = 0.16  # m between the tracks, longer than measured because they slip in turns

# Boats.
BOAT_SPEED: Final = 0.9  # m/s
BOAT_LAG_S: Final = 1.2
PROPELLER_LAG_S: Final = 0.2
REVERSE_THRUST: Final = 0.5  # Share of the thrust that remains astern.
RUDDER_RATE: Final = 1.2  # rad/s of turn at a speed of 1 and full rudder
TWIN_RATE: Final = 1.0  # rad/s of turn with one propeller ahead and one astern
TURN_LAG_S: Final = 0.5
DRIFT_S: Final = 0.6  # Time for which a hull slides in its old direction.


class VehicleMotion(NamedTuple):
    """Motion of a vehicle.

    Attributes:
        ahead: Speed along the heading, m/s.
        left: Speed to the left, m/s.
        yaw_rate: Rate of turn, rad/s, counter-clockwise seen from above.
    """

    ahead: float
    left: float
    yaw_rate: float


class RoomVehicle:
    """A body in the plain room that does not move, such as legs or a finger."""

    def move(self, dt_s: float, outputs: Outputs) -> VehicleMotion:
        """Advance by a short step and return the motion at its end.

        Args:
            dt_s: Length of the step, s.
            outputs: Output of each part, from -1 to 1; None for a part without torque.
        """
        return VehicleMotion(0.0, 0.0, 0.0)

    def halt(self) -> None:
        """Stop at once after a collision, while the motors continue."""


class _Car(RoomVehicle):
    """Wheels that drive and wheels that steer: the kinematic bicycle model."""

    def __init__(self) -> None:
        self._speed = 0.0
        self._steering = 0.0

    def move(self, dt_s: float, outputs: Outputs) -> VehicleMotion:
        throttle = _after_dead_band(outputs.get("wheels"))
        self._speed = _lagged(self._speed, CAR_SPEED * throttle, CAR_LAG_S, dt_s)
        steering = outputs.get("steering", 0.0)
        if steering is not None:  # A servo without pulses stays where it is.
            self._steering = _lagged(self._steering, steering, STEERING_LAG_S, dt_s)
        # Steering is negative to the left, a turn to the left is positive.
        return VehicleMotion(
            self._speed,
            0.0,
            -self._speed * math.tan(FULL_LOCK * self._steering) / WHEELBASE,
        )

    def halt(self) -> None:
        self._speed = 0.0


class _Tracks(RoomVehicle):
    """One track or row of wheels on each side."""

    def __init__(self) -> None:
        self._left = self._right = 0.0

    def move(self, dt_s: float, outputs: Outputs) -> VehicleMotion:
        left = TRACK_SPEED * _after_dead_band(outputs.get("left track"))
        right = TRACK_SPEED * _after_dead_band(outputs.get("right track"))
        self._left = _lagged(self._left, left, TRACK_LAG_S, dt_s)
        self._right = _lagged(self._right, right, TRACK_LAG_S, dt_s)
        ahead = (self._left + self._right) / 2
        return VehicleMotion(ahead, 0.0, (self._right - self._left) / TRACK_GAUGE)

    def halt(self) -> None:
        middle = (self._left + self._right) / 2
        self._left -= middle
        self._right -= middle


class _Boat(RoomVehicle):
    """A hull with a propeller and a rudder, or with two propellers."""

    def __init__(self) -> None:
        self._thrust = {"propeller": 0.0, "left propeller": 0.0, "right propeller": 0.0}
        self._ahead = self._left = self._yaw_rate = 0.0

    def move(self, dt_s: float, outputs: Outputs) -> VehicleMotion:
        for part in self._thrust:
            value = _after_dead_band(outputs.get(part))
            value *= REVERSE_THRUST if value < 0.0 else 1.0
            self._thrust[part] = _lagged(self._thrust[part], value, PROPELLER_LAG_S, dt_s)
        middle, left, right = self._thrust.values()
        thrust = middle + (left + right) / 2
        self._ahead = _lagged(self._ahead, BOAT_SPEED * thrust, BOAT_LAG_S, dt_s)
        # The rudder works on the water that flows by and on what the propeller throws at it.
        flow = self._ahead / BOAT_SPEED + max(middle, 0.0)
        turn = -RUDDER_RATE * flow * (outputs.get("rudder") or 0.0)
        turn += TWIN_RATE * (right - left) / (1.0 + REVERSE_THRUST)
        self._yaw_rate = _lagged(self._yaw_rate, turn, TURN_LAG_S, dt_s)
        # In a turn to the left the hull slides on to its right.
        self._left = _lagged(self._left, -self._ahead * self._yaw_rate * DRIFT_S, DRIFT_S, dt_s)
        return VehicleMotion(self._ahead, self._left, self._yaw_rate)

    def halt(self) -> None:
        self._ahead = self._left = 0.0


def _vehicle_for(parts: Collection[str]) -> RoomVehicle:
    """Return a vehicle with these parts.

    Raises:
        RobotError: If they belong to vehicles of different kinds.
    """
    kinds: list[type[RoomVehicle]] = []
    if {"wheels", "steering"} & set(parts):
        kinds.append(_Car)
    if {"left track", "right track"} & set(parts):
        kinds.append(_Tracks)
    if {"propeller", "left propeller", "right propeller", "rudder"} & set(parts):
        kinds.append(_Boat)
    if len(kinds) > 1:
        raise RobotError(f"No vehicle has all of these parts: {', '.join(sorted(parts))}.")
    return kinds[0]() if kinds else RoomVehicle()


def _after_dead_band(value: float | None) -> float:
    return 0.0 if value is None or abs(value) < DEAD_BAND else value


def _lagged(value: float, target: float, lag_s: float, dt_s: float) -> float:
    """Apply a first-order lag, exact for a constant target."""
    return target + (value - target) * math.exp(-dt_s / lag_s)


RADIUS: Final = 0.13  # m, of the disc around the middle that must not touch a wall
CONTACT: Final = 0.004  # m: something this near presses the bumper
BUMPER_SPREAD: Final = math.radians(75.0)  # Reach of the front bumper to each side.
LONGEST_STEP_S: Final = 0.01
IMPACT_S: Final = 0.03  # Time for which the accelerometer shows a collision.
SPEED_OF_IMPACT: Final = 0.15  # m/s: the accelerometer shows only faster collisions.
IMPACT_STOP_S: Final = 0.01  # Time in which a collision takes all the speed.

INNER_OHM: Final = 0.12  # Resistance of the battery and its leads.
IDLE_A: Final = 0.6  # Current of the computer.
MOTOR_A: Final = 3.0  # Current of a free-running motor at a value of 1, and
STALL_FACTOR: Final = 3.0  # its factor when the motor is blocked.

_CONE: Final = np.radians(np.array((-7.0, 0.0, 7.0)))  # The beam of an HC-SR04 is 15 degrees wide.


class DrivingWorld:
    """A vehicle in a rectangular room; see `World`.

    Args:
        parts: Parts that the vehicle's outputs move, such as "wheels".
        size: Width and height of the pictures in pixels.
        seed: Seed of the boxes and of the first start.
        pitch_deg: Angle of the camera's axis below the horizon, degrees; None for level.
        fovy_deg: Vertical field of view of the camera, degrees; None for 90 degrees across.

    Attributes:
        resting_v: Voltage of the battery without load, V.
    """

    def __init__(
        self,
        parts: Collection[str],
        size: tuple[int, int],
        seed: int,
        *,
        pitch_deg: float | None = None,
        fovy_deg: float | None = None,
    ) -> None:
        self._parts = frozenset(parts)
        self._vehicle = _vehicle_for(self._parts)
        self._camera = FrontCamera(size, pitch_deg, fovy_deg)
        self.resting_v = RESTING_V
        self._travelled = 0.0
        self.lay_out(seed)

    def lay_out(self, seed: int) -> None:
        """Replace the boxes; see `World.lay_out`."""
        self.room = lay_out(seed)
        self.place(seed)

    def truth(self) -> dict[str, float]:
        """Return no quantities; see `World.truth`."""
        return {}

    def place(self, seed: int) -> None:
        """Place the vehicle at a start, at rest; see `World.place`."""
        self._start = seed
        pose = find_start(self.room, seed)
        self._x, self._y, self._heading = pose.x, pose.y, pose.heading
        self._vehicle = _vehicle_for(self._parts)
        self._speed = self._left = self._yaw_rate = 0.0
        self._acceleration = 0.0
        self._impact = self._impact_left_s = 0.0
        self._current_a = IDLE_A
        self._blocked = False
        self._bumped = self._touches_ahead()

    def put_back(self) -> None:
        """Return the vehicle to its start, as the room has no lane; see `World.put_back`."""
        self.place(self._start)

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Advance time; see `World.advance`."""
        while dt_s > 1e-12:
            step_s = min(dt_s, LONGEST_STEP_S)
            self._step(step_s, outputs)
            dt_s -= step_s

    def inputs(self) -> Readings:
        """Return what sensors could measure; see `World.inputs`."""
        return Readings(
            pose=Pose(self._x, self._y, self._heading),
            speed=self._speed,
            travelled_m=self._travelled,
            acceleration_x=self._impact if self._impact_left_s > 0.0 else self._acceleration,
            acceleration_y=self._speed * self._yaw_rate,
            yaw_rate=self._yaw_rate,
            bumped=self._bumped,
            battery_v=self.resting_v - INNER_OHM * self._current_a,
            current_a=self._current_a,
        )

    def distance_m(self) -> float:
        """Return the shortest of three rays from the nose; see `World.distance_m`."""
        angles = self._heading + _CONE
        directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        return max(0.0, float(self.room.cast(self._x, self._y, directions)[0].min()) - RADIUS)

    def picture(self) -> NDArray[np.uint8]:
        """Return the picture of the front camera; see `World.picture`."""
        # From the middle of the disc, so that the camera is never inside a wall.
        return self._camera.picture(self.room, self._x, self._y, self._heading)

    def _step(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        ahead, left, yaw_rate = self._vehicle.move(dt_s, outputs)
        middle = self._heading + yaw_rate * dt_s / 2
        cos, sin = math.cos(middle), math.sin(middle)
        move_x = (ahead * cos - left * sin) * dt_s
        move_y = (ahead * sin + left * cos) * dt_s
        self._heading = math.remainder(self._heading + yaw_rate * dt_s, math.tau)
        share = self._free_share(move_x, move_y)
        self._x += share * move_x
        self._y += share * move_y
        self._travelled += share * ahead * dt_s
        self._blocked = share < 1.0
        self._impact_left_s -= dt_s
        if self._blocked:
            self._vehicle.halt()
            if abs(self._speed) > SPEED_OF_IMPACT:
                self._impact = -self._speed / IMPACT_STOP_S
                self._impact_left_s = IMPACT_S
            ahead = left = 0.0
        self._acceleration = (ahead - self._speed) / dt_s if not self._blocked else 0.0
        self._speed, self._left, self._yaw_rate = ahead, left, yaw_rate
        self._bumped = self._touches_ahead()
        load = sum(abs(value) for part, value in outputs.items() if value and part != "steering")
        self._current_a = IDLE_A + MOTOR_A * load * (STALL_FACTOR if self._blocked else 1.0)

    def _free_share(self, move_x: float, move_y: float) -> float:
        """Return the share of a move that is free of collisions."""
        if self.room.clearance(self._x + move_x, self._y + move_y)[0] >= RADIUS:
            return 1.0
        here = self.room.clearance(self._x, self._y)
        if move_x * (here[1] - self._x) + move_y * (here[2] - self._y) <= 0.0:
            return 1.0  # Away from what it touches.
        free, blocked = 0.0, 1.0
        for _ in range(8):
            share = (free + blocked) / 2
            gap = self.room.clearance(self._x + share * move_x, self._y + share * move_y)[0]
            free, blocked = (share, blocked) if gap >= RADIUS else (free, share)
        return free

    def _touches_ahead(self) -> bool:
        gap, x, y = self.room.clearance(self._x, self._y)
        if gap > RADIUS + CONTACT:
            return False
        bearing = math.atan2(y - self._y, x - self._x) - self._heading
        return abs(math.remainder(bearing, math.tau)) <= BUMPER_SPREAD
