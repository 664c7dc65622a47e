"""A vehicle in a room."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.twin.world.picture import FrontCamera
from shapechanger.twin.world.room import find_start, lay_out
from shapechanger.twin.world.vehicle import vehicle_for
from shapechanger.worlds.world import RESTING_V, Pose, Readings

__all__ = ["DrivingWorld"]

RADIUS: Final = 0.13  # m of the disc around its middle that may not touch a wall
CONTACT: Final = 0.004  # m: nearer than this, something presses the bumper
BUMPER_SPREAD: Final = math.radians(75.0)  # How far to each side the bumper at the front reaches.
LONGEST_STEP_S: Final = 0.01
IMPACT_S: Final = 0.03  # How long the accelerometer shows the blow of a collision.
SPEED_OF_IMPACT: Final = 0.15  # m/s: slower than this, a collision is no blow.
IMPACT_STOP_S: Final = 0.01  # Time in which a collision takes all the speed.

INNER_OHM: Final = 0.12  # Of the battery and its leads.
IDLE_A: Final = 0.6  # What the computer takes.
MOTOR_A: Final = 3.0  # What a motor takes at a value of 1 when it runs freely, and
STALL_FACTOR: Final = 3.0  # how much more when it cannot turn.

_CONE: Final = np.radians(np.array((-7.0, 0.0, 7.0)))  # An HC-SR04 hears 15 degrees.


class DrivingWorld:
    """A vehicle in a rectangular room; see `World`.

    Args:
        parts: What the vehicle's outputs move, such as "wheels".
        size: Width and height of the pictures in pixels.
        seed: Where the boxes stand, and the first start.

    Attributes:
        resting_v: Voltage of the battery without load.
    """

    def __init__(self, parts: Collection[str], size: tuple[int, int], seed: int) -> None:
        self._parts = frozenset(parts)
        self._vehicle = vehicle_for(self._parts)
        self._camera = FrontCamera(size)
        self.resting_v = RESTING_V
        self._travelled = 0.0
        self.lay_out(seed)

    def lay_out(self, seed: int) -> None:
        """Put other boxes into the room; see `World.lay_out`."""
        self.room = lay_out(seed)
        self.place(seed)

    def truth(self) -> dict[str, float]:
        """Nothing: nobody counts here; see `World.truth`."""
        return {}

    def place(self, seed: int) -> None:
        """Put the vehicle at a start, at rest; see `World.place`."""
        self._start = seed
        pose = find_start(self.room, seed)
        self._x, self._y, self._heading = pose.x, pose.y, pose.heading
        self._vehicle = vehicle_for(self._parts)
        self._speed = self._left = self._yaw_rate = 0.0
        self._acceleration = 0.0
        self._impact = self._impact_left_s = 0.0
        self._current_a = IDLE_A
        self._blocked = False
        self._bumped = self._touches_ahead()

    def put_back(self) -> None:
        """Put the vehicle at its start again: a room has no lane; see `World.put_back`."""
        self.place(self._start)

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Let time go by; see `World.advance`."""
        while dt_s > 1e-12:
            step_s = min(dt_s, LONGEST_STEP_S)
            self._step(step_s, outputs)
            dt_s -= step_s

    def inputs(self) -> Readings:
        """What sensors could measure now; see `World.inputs`."""
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
        """The shortest of three rays from the nose; see `World.distance_m`."""
        angles = self._heading + _CONE
        directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        return max(0.0, float(self.room.cast(self._x, self._y, directions)[0].min()) - RADIUS)

    def picture(self) -> NDArray[np.uint8]:
        """What the camera at the nose sees; see `World.picture`."""
        # At the middle of the disc and not at its rim, so that it is never inside a wall.
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
        """Which share of a move does not run into anything."""
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
