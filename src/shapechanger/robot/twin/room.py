"""A rectangular room that needs no simulator, for robots without a world, and their motion in it.

It proves a robot's programs: things move, turn, hit walls and are seen. Its constants are typical
of toys of 20 to 30 cm; none was measured.
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

ROOM_LENGTH: Final = 6.0  # m, along x from 0
ROOM_WIDTH: Final = 4.0  # m, along y from 0
RADIUS: Final = 0.13  # m, of the disc around the vehicle's middle that must not touch a wall
_START_CLEARANCE: Final = 0.45  # m that are free around a start
_START_AHEAD: Final = 1.4  # m that are free ahead of it
_LOOK_AHEAD: Final = np.radians(np.array((-15.0, 0.0, 15.0)))
_CONE: Final = np.radians(np.array((-7.0, 0.0, 7.0)))  # The beam of an HC-SR04 is 15 degrees wide.

DEAD_BAND: Final = 0.04
"""Size of a value below which friction holds a motor."""

CAR_SPEED: Final = 1.5
"""Speed of a car at full throttle, m/s."""

_STEERING_LAG_S: Final = 0.08
_CONTACT: Final = 0.004  # m: something this near presses the bumper
_BUMPER_SPREAD: Final = math.radians(75.0)  # Reach of the front bumper to each side.
_LONGEST_STEP_S: Final = 0.01
_IMPACT_S: Final = 0.03  # Time for which the accelerometer shows a collision.
_SPEED_OF_IMPACT: Final = 0.15  # m/s: the accelerometer shows only faster collisions.
_IMPACT_STOP_S: Final = 0.01  # Time in which a collision takes all the speed.

_INNER_OHM: Final = 0.12  # Resistance of the battery and its leads.
_IDLE_A: Final = 0.6  # Current of the computer.
_MOTOR_A: Final = 3.0  # Current of a free-running motor at a value of 1, and
_STALL_FACTOR: Final = 3.0  # its factor when the motor is blocked.


class _Drive(NamedTuple):
    """Motion of a kind of vehicle.

    Attributes:
        ahead: Speed that each part gives at a value of 1, m/s.
        turn: Rate of turn that it gives, rad/s, counter-clockwise seen from above.
        rudder: Part that steers; "" if only the sides do.
        curvature: Turn to the right for each metre at full rudder, rad/m.
        lag_s: Time in which the motion covers 63 % of a difference.
    """

    ahead: Mapping[str, float]
    turn: Mapping[str, float] = {}
    rudder: str = ""
    curvature: float = 0.0
    lag_s: float = 0.15


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


def _drive_of(parts: Collection[str]) -> _Drive:
    """Return the kind of vehicle with these parts; one that does not move for others."""
    kinds = [one for one in _DRIVES if {*one.ahead, one.rudder} & set(parts)]
    if len(kinds) > 1:
        raise RobotError(f"No vehicle has all of these parts: {', '.join(sorted(parts))}.")
    return kinds[0] if kinds else _Drive({})


def _cast(
    x: float, y: float, angles: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
    """Return where rays from a point hit the walls.

    Returns:
        Distance, m, number of the wall, 0 to 3, and place along it, m, of each ray.
    """
    cos, sin = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        to_end = np.where(cos > 0.0, ROOM_LENGTH - x, x) / np.abs(cos)
        to_side = np.where(sin > 0.0, ROOM_WIDTH - y, y) / np.abs(sin)
    is_end = to_end < to_side
    distance = np.minimum(to_end, to_side)
    wall = np.where(is_end, cos > 0.0, 2 + (sin > 0.0)).astype(np.intp)
    along = np.where(is_end, y + distance * sin, x + distance * cos)
    return distance, wall, along


class DrivingWorld(World):
    """A vehicle in the room; see `World`.

    Args:
        parts: Parts that the robot's outputs move, such as "wheels".
        size: Width and height of the frames in pixels.
        seed: Seed of where the stripes on the walls begin, and of the first start.
        pitch_deg: Angle of the camera's axis below the horizon, degrees; None for level.
        fovy_deg: Vertical field of view of the camera, degrees; None for 90 degrees across.

    Raises:
        RobotError: If the parts belong to vehicles of different kinds.
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
        self._drive = _drive_of(parts)
        first_stripe = random.Random(f"room {seed}").uniform(0.0, 2.0 * _STRIPE)
        self._camera = _FrontCamera(size, first_stripe, pitch_deg, fovy_deg)
        self.resting_v = RESTING_V
        self._travelled = 0.0
        self.place(seed)

    def truth(self) -> dict[str, float]:
        """Return no quantities."""
        return {}

    def place(self, seed: int) -> None:
        """Put the vehicle at a start with free space around and more of it ahead, at rest."""
        self._seed = seed
        rng = random.Random(f"start {seed}")
        free = 0.0
        while free < _START_AHEAD:
            self._x = rng.uniform(_START_CLEARANCE, ROOM_LENGTH - _START_CLEARANCE)
            self._y = rng.uniform(_START_CLEARANCE, ROOM_WIDTH - _START_CLEARANCE)
            self._heading = rng.uniform(-math.pi, math.pi)
            free = float(_cast(self._x, self._y, self._heading + _LOOK_AHEAD)[0].min())
        self._speed = self._yaw_rate = self._side_turn = self._steering = 0.0
        self._acceleration = self._impact = self._impact_left_s = 0.0
        self._current_a = _IDLE_A
        self._bumped = False

    def put_back(self) -> None:
        """Return the vehicle to its start, as the room has no lane."""
        self.place(self._seed)

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Advance time; see `World.advance`."""
        while dt_s > 1e-12:
            step_s = min(dt_s, _LONGEST_STEP_S)
            self._step(step_s, outputs)
            dt_s -= step_s

    def inputs(self) -> Readings:
        """Return the quantities that sensors measure."""
        return Readings(
            pose=Pose(self._x, self._y, self._heading),
            speed=self._speed,
            travelled_m=self._travelled,
            acceleration_x=self._impact if self._impact_left_s > 0.0 else self._acceleration,
            acceleration_y=self._speed * self._yaw_rate,
            yaw_rate=self._yaw_rate,
            bumped=self._bumped,
            battery_v=self.resting_v - _INNER_OHM * self._current_a,
            current_a=self._current_a,
        )

    def distance_m(self) -> float:
        """Return the shortest of three rays from the nose."""
        return max(0.0, float(_cast(self._x, self._y, self._heading + _CONE)[0].min()) - RADIUS)

    def picture(self) -> NDArray[np.uint8]:
        """Return the frame of the front camera, which is in the middle of the vehicle."""
        return self._camera.draw(self._x, self._y, self._heading)

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
        move = self._speed * dt_s
        share = min(
            _free_share(self._x, move * math.cos(middle), ROOM_LENGTH),
            _free_share(self._y, move * math.sin(middle), ROOM_WIDTH),
        )
        self._x += share * move * math.cos(middle)
        self._y += share * move * math.sin(middle)
        self._heading = math.remainder(self._heading + self._yaw_rate * dt_s, math.tau)
        self._travelled += share * move
        self._impact_left_s -= dt_s
        self._acceleration = (self._speed - before) / dt_s
        load = sum(map(abs, values.values()))
        if share < 1.0:
            if abs(before) > _SPEED_OF_IMPACT:
                self._impact, self._impact_left_s = -before / _IMPACT_STOP_S, _IMPACT_S
            self._speed = self._acceleration = 0.0
            load *= _STALL_FACTOR
        self._current_a = _IDLE_A + _MOTOR_A * load
        self._bumped = self._touches_ahead()

    def _touches_ahead(self) -> bool:
        gaps = (
            (ROOM_LENGTH - self._x, 0.0),
            (ROOM_WIDTH - self._y, math.pi / 2),
            (self._x, math.pi),
            (self._y, -math.pi / 2),
        )
        return any(
            gap <= RADIUS + _CONTACT
            and abs(math.remainder(bearing - self._heading, math.tau)) <= _BUMPER_SPREAD
            for gap, bearing in gaps
        )


def _lagged(value: float, target: float, lag_s: float, dt_s: float) -> float:
    """Apply a first-order lag, exact for a constant target."""
    return target + (value - target) * math.exp(-dt_s / lag_s)


def _free_share(place: float, move: float, length: float) -> float:
    """Return the share of a move along an axis before a wall, 0 to 1."""
    limit = length - RADIUS if move > 0.0 else RADIUS
    return 1.0 if move == 0.0 else min(1.0, max(0.0, (limit - place) / move))


_FIELD_OF_VIEW: Final = math.radians(90.0)  # From left to right, if no profile states another.
_CAMERA_HEIGHT: Final = 0.12  # m above the floor
_WALL_HEIGHT: Final = 0.4  # m
_STRIPE: Final = 0.25  # m: width of the stripes on walls
_FADE: Final = 4.0  # m at which a wall has lost 63 % of its light
_STEEP: Final = 0.75  # Slope of a line of sight at which floor and ceiling are lightest.
_CEILING: Final = np.array((205.0, 210.0, 215.0), np.float32)
_FLOOR: Final = np.array((120.0, 95.0, 70.0), np.float32)
_WALLS: Final = np.array(((220, 70, 60), (70, 150, 220), (235, 190, 60), (90, 180, 90)), np.float32)


class _FrontCamera:
    """Draws the room, whose stripes begin at `first_stripe`, m; see `DrivingWorld`."""

    def __init__(
        self,
        size: tuple[int, int],
        first_stripe: float,
        pitch_deg: float | None,
        fovy_deg: float | None,
    ) -> None:
        self._first_stripe = first_stripe
        width, height = size
        if fovy_deg is None:
            focal = (width / 2) / math.tan(_FIELD_OF_VIEW / 2)  # In pixels.
        else:
            focal = (height / 2) / math.tan(math.radians(fovy_deg) / 2)
        pitch = math.radians(pitch_deg or 0.0)
        right = (np.arange(width) + 0.5 - width / 2) / focal
        below = ((np.arange(height) + 0.5 - height / 2) / focal)[:, np.newaxis]
        ahead = math.cos(pitch) - math.sin(pitch) * below
        down = math.sin(pitch) + math.cos(pitch) * below
        # One ray along the floor serves all pixels of a bearing; two for each column.
        bearings = -np.arctan2(right, ahead)
        first, last = float(bearings.min()), float(bearings.max())
        self._angles: NDArray[np.float64] = np.linspace(first, last, 2 * width)
        step = (last - first) / (2 * width - 1)
        self._rays = np.rint((bearings - first) / step).astype(np.intp)
        # How far a pixel looks down for each metre along the floor.
        self._slopes = (down / np.hypot(right, ahead)).astype(np.float32)
        # Light falls off towards the horizon, on the floor and on the ceiling.
        near = np.minimum(np.abs(self._slopes) / _STEEP, 1.0)[..., np.newaxis]
        self._background = np.where(
            self._slopes[..., np.newaxis] > 0.0,
            _FLOOR * (0.55 + 0.45 * near),
            _CEILING * (0.8 + 0.2 * near),
        ).astype(np.uint8)

    def draw(self, x: float, y: float, heading: float) -> NDArray[np.uint8]:
        """Draw a frame from a pose, RGB, shape (height, width, 3)."""
        distance, wall, along = _cast(x, y, heading + self._angles)
        light = 0.25 + 0.75 * np.exp(-distance / _FADE)
        light *= np.where(((along + self._first_stripe) // _STRIPE) % 2 == 0, 1.0, 0.72)
        colours = (_WALLS[wall] * light[:, np.newaxis]).astype(np.uint8)
        # Below the camera where the line of sight meets the wall, m.
        rise = self._slopes * distance.astype(np.float32)[self._rays]
        is_wall = (rise >= _CAMERA_HEIGHT - _WALL_HEIGHT) & (rise < _CAMERA_HEIGHT)
        picture = self._background.copy()
        picture[is_wall] = colours[self._rays[is_wall]]
        return picture
