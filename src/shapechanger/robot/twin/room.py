"""A rectangular room that needs no simulator, and the motion of vehicles in it.

It is sufficient to test a robot's programs: vehicles move, turn, and hit and see walls. The
constants are typical of toys of 20 to 30 cm; they were not measured.
"""

from __future__ import annotations

import math
import random
from collections.abc import Collection, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.world import RESTING_V, Pose, Readings, World
from shapechanger.errors import RobotError

ROOM_LENGTH: Final = 6.0  # Size of the room along x, from 0, m.
ROOM_WIDTH: Final = 4.0  # Size of the room along y, from 0, m.
RADIUS: Final = 0.13  # Radius of a vehicle, a disc that cannot enter a wall, m.
_START_CLEARANCE: Final = 0.45  # Least distance of a start from each wall, m.
_START_AHEAD: Final = 1.4  # Least free distance ahead of a start, m.
_LOOK_AHEAD: Final = np.radians(np.array((-15.0, 0.0, 15.0)))
_CONE: Final = np.radians(np.array((-7.0, 0.0, 7.0)))  # The beam of an HC-SR04 is 15 degrees wide.

DEAD_BAND: Final = 0.04
"""Magnitude of a motor's value below which friction keeps it from turning."""

CAR_SPEED: Final = 1.5
"""Speed of a car at full throttle, m/s."""

_STEERING_LAG_S: Final = 0.08
_CONTACT: Final = 0.004  # Distance at which a wall presses the bumper, m.
_BUMPER: Final = np.radians(np.arange(-75.0, 76.0, 7.5))  # Bearings that the bumper covers, rad.
_LONGEST_STEP_S: Final = 0.01
_SAG_V: Final = 0.36  # Drop of the battery's voltage with one motor at full value, V.

_FIELD_OF_VIEW: Final = math.radians(90.0)  # Horizontal default, rad.
_CAMERA_HEIGHT: Final = 0.12  # Height of the camera above the floor, m.
_WALL_HEIGHT: Final = 0.4  # Height of the walls, m.
_STRIPE: Final = 0.25  # Width of the stripes on the walls, m.
_FADE: Final = 4.0  # Distance at which a wall has lost 47 % of its light, m.
_CEILING: Final = np.array((185, 189, 194), np.uint8)
_FLOOR: Final = np.array((90, 71, 52), np.uint8)
_WALLS: Final = np.array(((220, 70, 60), (70, 150, 220), (235, 190, 60), (90, 180, 90)), np.float32)


class _Drive(NamedTuple):
    """Motion of a kind of vehicle."""

    ahead: Mapping[str, float]  # Speed for a value of 1, m/s, keyed by part.
    turn: Mapping[str, float] = {}  # Rate of turn for a value of 1, rad/s, counter-clockwise.
    rudder: str = ""  # Part that steers; "" if only the sides do.
    curvature: float = 0.0  # Turn to the right for each metre at full rudder, rad/m.
    lag_s: float = 0.15  # Time constant of the speed, s.


_Floats = NDArray[np.float64]

_DRIVES: Final = (
    # A wheelbase of 0.18 m, and front wheels that turn by 28 degrees.
    _Drive({"wheels": CAR_SPEED}, rudder="steering", curvature=2.95),
    _Drive(
        {"left track": 0.4, "right track": 0.4},
        {"left track": -5.0, "right track": 5.0},
        lag_s=0.12,
    ),
    _Drive(
        {"propeller": 0.9, "left propeller": 0.45, "right propeller": 0.45},
        {"left propeller": -1.0, "right propeller": 1.0},
        rudder="rudder",
        curvature=1.3,
        lag_s=1.2,
    ),
)


class DrivingWorld(World):
    """A vehicle in the room; see `World`.

    `parts` are the parts that the robot's outputs move, such as "wheels"; they must belong to one
    kind of vehicle. The `seed` selects the stripes on the walls and the first start.
    """

    def __init__(
        self,
        parts: Collection[str],
        size: tuple[int, int],  # Width and height of the frames, pixels.
        seed: int,
        pitch_deg: float | None = None,  # Angle of the camera below the horizon; None for 0.
        fovy_deg: float | None = None,  # Vertical; None for 90 degrees horizontally.
    ) -> None:
        kinds = [one for one in _DRIVES if {*one.ahead, one.rudder} & set(parts)]
        if len(kinds) > 1:
            raise RobotError(f"No vehicle has all of these parts: {', '.join(sorted(parts))}.")
        self._drive = kinds[0] if kinds else _Drive({})  # Other parts do not move.
        self._first_stripe = random.Random(f"room {seed}").uniform(0.0, 2.0 * _STRIPE)
        (width, height), pitch = size, math.radians(pitch_deg or 0.0)
        across = width if fovy_deg is None else height
        angle = _FIELD_OF_VIEW if fovy_deg is None else math.radians(fovy_deg)
        focal = (across / 2) / math.tan(angle / 2)  # In pixels.
        right = (np.arange(width) + 0.5 - width / 2) / focal
        below = ((np.arange(height) + 0.5 - height / 2) / focal)[:, np.newaxis]
        down = math.sin(pitch) + math.cos(pitch) * below
        ahead = math.cos(pitch) - math.sin(pitch) * below
        # The bearing of each column, rad, and the downward slope of each pixel's ray. All pixels of
        # a column have the bearing of its middle, also if the camera is pitched.
        self._bearings = -np.arctan2(right, math.cos(pitch))
        self._slopes = down / np.hypot(right, ahead)
        self._travelled = 0.0
        self.place(seed)

    def truth(self) -> dict[str, float]:
        """Return an empty dictionary, because the room has no further quantities."""
        return {}

    def place(self, seed: int) -> None:
        """Put the vehicle at rest at a random start with free space around it and ahead."""
        self._seed = seed
        rng = random.Random(f"start {seed}")
        free = 0.0
        while free < _START_AHEAD:
            self._x = rng.uniform(_START_CLEARANCE, ROOM_LENGTH - _START_CLEARANCE)
            self._y = rng.uniform(_START_CLEARANCE, ROOM_WIDTH - _START_CLEARANCE)
            self._heading = rng.uniform(-math.pi, math.pi)
            free = float(self._cast(_LOOK_AHEAD)[0].min())
        self._speed = self._yaw_rate = self._side_turn = self._steering = 0.0
        self._acceleration = self._load = 0.0

    def put_back(self) -> None:
        """Return the vehicle to its start, because the room has no lane."""
        self.place(self._seed)

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Advance time; see `World.advance`."""
        while dt_s > 1e-12:
            self._step(min(dt_s, _LONGEST_STEP_S), outputs)
            dt_s -= _LONGEST_STEP_S

    def inputs(self) -> Readings:
        """Return the quantities that sensors measure."""
        return Readings(
            pose=Pose(self._x, self._y, self._heading),
            speed=self._speed,
            travelled_m=self._travelled,
            acceleration_x=self._acceleration,
            acceleration_y=self._speed * self._yaw_rate,
            yaw_rate=self._yaw_rate,
            bumped=bool(self._cast(_BUMPER)[0].min() <= RADIUS + _CONTACT),
            battery_v=RESTING_V - _SAG_V * self._load,
        )

    def distance_m(self) -> float:
        """Return the shortest distance along three rays from the nose, m."""
        return max(0.0, float(self._cast(_CONE)[0].min()) - RADIUS)

    def picture(self) -> NDArray[np.uint8]:
        """Return the frame of the front camera, which is in the middle of the vehicle."""
        distance, wall, along = self._cast(self._bearings)
        light = 0.25 + 0.75 * np.exp(-distance / _FADE)
        light *= np.where(((along + self._first_stripe) // _STRIPE) % 2 == 0, 1.0, 0.72)
        colours = (_WALLS[wall] * light[:, np.newaxis]).astype(np.uint8)
        # Height below the camera at which the line of sight meets the wall, m.
        below = (self._slopes * distance)[..., np.newaxis]
        picture = np.where(below < _CAMERA_HEIGHT, colours, _FLOOR)
        return np.where(below < _CAMERA_HEIGHT - _WALL_HEIGHT, _CEILING, picture)

    def _cast(self, bearings: _Floats) -> tuple[_Floats, NDArray[np.intp], _Floats]:
        """Return each ray's distance to a wall, m, the wall, 0 to 3, and the place along it, m."""
        cos, sin = np.cos(self._heading + bearings), np.sin(self._heading + bearings)
        with np.errstate(divide="ignore"):
            to_end = np.where(cos > 0.0, ROOM_LENGTH - self._x, self._x) / np.abs(cos)
            to_side = np.where(sin > 0.0, ROOM_WIDTH - self._y, self._y) / np.abs(sin)
        is_end = to_end < to_side
        distance = np.minimum(to_end, to_side)
        wall = np.where(is_end, cos > 0.0, 2 + (sin > 0.0)).astype(np.intp)
        along = np.where(is_end, self._y + distance * sin, self._x + distance * cos)
        return distance, wall, along

    def _step(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        drive, before = self._drive, self._speed
        values = {part: outputs.get(part) or 0.0 for part in drive.ahead}
        values = {part: v if abs(v) >= DEAD_BAND else 0.0 for part, v in values.items()}
        ahead = sum(speed * values[part] for part, speed in drive.ahead.items())
        turn = sum(rate * values[part] for part, rate in drive.turn.items())
        self._speed = _lagged(self._speed, ahead, drive.lag_s, dt_s)
        self._side_turn = _lagged(self._side_turn, turn, drive.lag_s, dt_s)
        steering = outputs.get(drive.rudder, 0.0)
        if steering is not None:  # A servo without pulses keeps its position.
            self._steering = _lagged(self._steering, steering, _STEERING_LAG_S, dt_s)
        self._yaw_rate = self._side_turn - drive.curvature * self._steering * self._speed
        middle = self._heading + self._yaw_rate * dt_s / 2
        x, y = self._speed * dt_s * math.cos(middle), self._speed * dt_s * math.sin(middle)
        share = min(_free_share(self._x, x, ROOM_LENGTH), _free_share(self._y, y, ROOM_WIDTH))
        self._x += share * x
        self._y += share * y
        self._heading = math.remainder(self._heading + self._yaw_rate * dt_s, math.tau)
        self._travelled += share * self._speed * dt_s
        if share < 1.0:
            self._speed = 0.0
        self._acceleration = (self._speed - before) / dt_s
        self._load = sum(map(abs, values.values()))


def _lagged(value: float, target: float, lag_s: float, dt_s: float) -> float:
    """Apply a first-order lag, exact for a constant target."""
    return target + (value - target) * math.exp(-dt_s / lag_s)


def _free_share(place: float, move: float, length: float) -> float:
    """Return the share of a move along an axis that is possible before a wall, 0 to 1."""
    limit = length - RADIUS if move > 0.0 else RADIUS
    return 1.0 if move == 0.0 else min(1.0, max(0.0, (limit - place) / move))
