"""Driver that follows a path planned on the whole course.

The steering is pure pursuit: R. C. Coulter, "Implementation of the Pure Pursuit Path Tracking
Algorithm", CMU-RI-TR-92-01 (1992). The circle that is tangent to the vehicle's heading and passes
through a point at distance L and angle a has the curvature 2 sin(a) / L. A boat drifts, so it aims
like a ship on a line of sight (T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion
Control", 2011, chapter 10), with its drift angle subtracted.
"""

from __future__ import annotations

import math
import tomllib
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.world import Pose
from shapechanger.errors import WorldError
from shapechanger.vehicles.bodies import VEHICLES, VehicleModel, vehicle_model
from shapechanger.vehicles.courses.course import Course
from shapechanger.vehicles.courses.geometry import ClearanceField, Spot
from shapechanger.vehicles.expert import PERIOD_S
from shapechanger.vehicles.expert.path import CoursePath, plan_path


@dataclass(frozen=True, slots=True)
class Traits:
    """Driving properties of a vehicle, tuned on training courses."""

    body: VehicleModel
    drive: Literal["wheels", "tracks", "rudder"]
    margin_m: float  # Smallest clearance on each side, for the corners of the hull and for errors.
    comfort_m: float  # Preferred clearance.
    cruise: float  # Share of the top speed on free, straight lanes.
    lateral_limit: float  # Largest lateral acceleration, m/s2.
    braking: float  # Reliable deceleration, m/s2.
    look_m: float  # Look-ahead distance at rest, m.
    look_s: float  # Additional look-ahead distance per speed, s.
    # Effect of full steering: for wheels the curvature, tan(full lock) divided by the wheelbase,
    # 1/m; for tracks the rate of turn, rad/s; for a rudder the rate of turn per speed, rad/m.
    turn: float
    dead: float = 0.0  # Dead band of a tank's steering, caused by friction of the tracks.
    sway: float = 0.25  # Standard deviation of steering noise that the driver can correct.
    least_throttle: float = 0.0  # Smallest throttle while driving forward; negative values brake.

    @property
    def half_width_m(self) -> float:
        """Half of the vehicle's largest width, m."""
        return self.body.width_m / 2


_FILE: Final = Path(__file__).with_name("traits.toml")

TRAITS: Final[Mapping[str, Traits]] = MappingProxyType(
    {
        name: Traits(body=VEHICLES[name], **numbers)
        for name, numbers in tomllib.loads(_FILE.read_text("utf-8")).items()
    }
)
"""Driving properties, keyed by the name of the vehicle."""


def traits_of(name: str) -> Traits:
    """Find driving properties by the name of the vehicle."""
    return TRAITS[vehicle_model(name).name]


def plan_path_for(course: Course, traits: Traits) -> CoursePath:
    """Plan a path for a vehicle, with two thirds of its margin if the whole margin does not fit.

    Corridors are made for land vehicles: 6 of the first 1,300 training courses have passages that
    are too narrow for the whole margin of a boat.
    """
    half_width_m, margin_m, comfort_m = traits.half_width_m, traits.margin_m, traits.comfort_m
    try:
        return plan_path(course, half_width_m, margin_m, comfort_m=comfort_m)
    except WorldError:
        return plan_path(course, half_width_m, 2.0 / 3.0 * margin_m, comfort_m=comfort_m)


def _speed_profile(path: CoursePath, traits: Traits) -> NDArray[np.float64]:
    """Speed at each point of a path, m/s, (N,).

    Lateral acceleration in curves, narrow passages, and braking before them limit the speed.
    """
    least = traits.half_width_m + traits.margin_m
    comfort = traits.half_width_m + traits.comfort_m
    room = np.clip((path.clearance - least) / (comfort - least), 0.0, 1.0)
    speed = traits.body.top_speed_mps * traits.cruise * (0.65 + 0.35 * room)
    bend = np.maximum(np.abs(path.curvature), 1e-6)
    speed = np.minimum(speed, np.sqrt(traits.lateral_limit / bend))
    step = path.length / len(speed)
    for i in range(2 * len(speed) - 1, -1, -1):  # Two laps, because the path is closed.
        here, after = i % len(speed), (i + 1) % len(speed)
        can_brake_from = np.sqrt(speed[after] ** 2 + 2 * traits.braking * step)
        speed[here] = min(speed[here], can_brake_from)
    return speed


def _clipped(value: float) -> float:
    return max(-1.0, min(1.0, value))


# Time constant of the average drift angle, s, long enough to average over turns.
_DRIFT_S: Final = 0.8
# Rate of turn, rad/s, above which a tank's whole dead band is compensated. At smaller rates a part
# is compensated, so that the tank does not twitch on straights.
_STICKING: Final = 0.1
# Angle to the target, rad, above which a tank turns on the spot, and the rate of this turn divided
# by the angle, 1/s. Friction would stop a slower turn.
_ABOUT: Final = 0.9
_ABOUT_RATE: Final = 2.5
# A driven vehicle counts as stuck if it stands still for `_PATIENCE_S` seconds, and as scraping
# along a wall if it is slow for `_SCRAPING_S` seconds.
_PATIENCE_S: Final = 0.7
_SCRAPING_S: Final = 3.0
_ASKED: Final = 0.25  # Throttle or steering above which a vehicle counts as driven.
# Shares of the top speed below which a vehicle stands still, or is slow; and rate of turn, rad/s,
# above which a vehicle does not stand still.
_STILL: Final = 0.05
_SLOW: Final = 0.25
_TURNING: Final = 0.15
_BACK_AT_MOST_S: Final = 4.0
_BACK_THROTTLE: Final = -0.6
_SPEED_GAIN: Final = 1.5  # Gain from speed error to throttle, both relative to their maxima.
_REACTION_S: Final = 0.15  # Delay from an action to its effect, over which the pose is predicted.
# Angle to the target, rad, above which a vehicle must turn before it drives on; and clearance ahead
# of the nose, m, below which it cannot turn.
_ASIDE: Final = 0.7
_BLOCKED_M: Final = 0.15


class _Recovery:
    """Detects that a vehicle is stuck, and then takes over for a manoeuvre."""

    def __init__(self, traits: Traits, rng: np.random.Generator) -> None:
        self._traits = traits
        self._rng = rng
        self._moves: deque[tuple[float, float, float]] = deque()  # Seconds, steering, throttle.
        self._left_s = 0.0  # Remaining time of the first move.
        self._still_s = self._slow_s = self._free_s = 0.0
        self._tries = 0

    def watch(
        self, action: tuple[float, float], speed: float, yaw_rate: float, *, blocked: bool
    ) -> None:
        """Update the timers from steering and throttle, speed, m/s, and rate of turn, rad/s.

        `blocked` states whether an obstacle ahead prevents a necessary turn.
        """
        share = abs(speed) / self._traits.body.top_speed_mps
        driven = abs(action[1]) > _ASKED
        turned = self._traits.drive == "tracks" and abs(action[0]) > _ASKED
        straight = abs(yaw_rate) < _TURNING  # Turning on the spot is progress.
        still = share < _STILL and straight
        # Only a tank can turn away from a wall on the spot. A car would scrape along the wall, and
        # the stern of a boat would touch the wall too.
        still |= blocked and share < _SLOW and action[1] > 0 and self._traits.drive != "tracks"
        self._still_s = self._still_s + PERIOD_S if still and (driven or turned) else 0.0
        self._slow_s = self._slow_s + PERIOD_S if share < _SLOW and straight and driven else 0.0
        self._free_s = self._free_s + PERIOD_S if share >= _SLOW else 0.0
        if self._free_s > _SCRAPING_S and not self._moves:
            self._tries = 0

    def action(self, angle: float) -> tuple[float, float] | None:
        """Steering and throttle of the manoeuvre, for an angle to the target; None if not stuck."""
        if self._moves:
            self._left_s -= PERIOD_S
            if self._left_s <= 0 or self._still_s > _PATIENCE_S:  # Finished, or stuck again.
                self._moves.popleft()
                self._begin_move()
        elif self._still_s > _PATIENCE_S - PERIOD_S / 2:
            self._begin(angle, scraping=False)
        elif self._slow_s > _SCRAPING_S:
            self._begin(angle, scraping=True)
        return self._moves[0][1:] if self._moves else None

    def _begin(self, angle: float, *, scraping: bool) -> None:
        """Choose the moves of a manoeuvre."""
        self._tries += 1
        longer = 1.4 ** (self._tries - 1) * self._rng.uniform(0.8, 1.2)
        side = 1.0 if angle >= 0 else -1.0
        if self._tries > 2 and self._rng.random() < 0.4:
            side = -side
        if self._traits.drive == "rudder" and scraping:
            # A rudder moves the stern, but a quay at the side blocks the stern. Steering towards
            # the quay frees the stern; then the boat moves backwards.
            self._moves.append((1.5 * longer, side, 0.5))
        seconds = (2.5 if self._traits.drive == "rudder" else 1.0) * longer
        # When driving backwards, wheels and rudders turn the vehicle the other way; tracks do not.
        turn = side * min(1.0, 0.4 + abs(angle)) * (-0.5 if self._traits.drive == "tracks" else 1.0)
        self._moves.append((min(seconds, _BACK_AT_MOST_S), turn, _BACK_THROTTLE))
        self._begin_move()

    def _begin_move(self) -> None:
        self._left_s = self._moves[0][0] if self._moves else 0.0
        self._still_s = self._slow_s = 0.0


class CourseExpert:
    """Drives a vehicle around a course, along a path, which is planned unless given.

    `seed` determines the recovery manoeuvres. `speeds` are the speeds at the points of the path,
    m/s, (N,).
    """

    def __init__(
        self, course: Course, vehicle: str, seed: int = 0, *, path: CoursePath | None = None
    ) -> None:
        traits = self._traits = traits_of(vehicle)
        self.path = path or plan_path_for(course, traits)
        self.speeds = _speed_profile(self.path, traits)
        self._obstacles = ClearanceField(course)
        self._rng = np.random.default_rng(seed)
        self._station: float | None = None

    def reset(self, pose: Pose) -> None:
        """Start at a pose."""
        self._station = self.path.nearest(pose.x, pose.y).station
        self._before: Pose | None = None
        self._drift = 0.0
        self._recovery = _Recovery(self._traits, self._rng)

    def act(self, pose: Pose, speed: float, yaw_rate: float = 0.0) -> NDArray[np.float32]:
        """Choose steering and throttle, -1 to 1, (2,), once per period; -1 steers left.

        `speed` is along the heading, m/s; `yaw_rate`, rad/s, is counter-clockwise from above.
        """
        if self._station is None:
            self.reset(pose)
        self._follow_drift(pose)
        soon = self._soon(pose, speed, yaw_rate)
        spot = self.path.nearest(soon.x, soon.y, self._station)
        self._station = spot.station
        look = self._traits.look_m + self._traits.look_s * max(speed, 0.0)
        x, y = self.path.at(spot.station + look)
        angle = math.remainder(math.atan2(y - soon.y, x - soon.x) - soon.heading, math.tau)
        action = self._recovery.action(angle)
        if action is None:
            distance = max(math.hypot(x - soon.x, y - soon.y), 0.1)
            steering = self._steering(angle, distance, speed, yaw_rate)
            action = self._driven(steering, spot, angle, speed)
        blocked = abs(angle) > _ASIDE and self._room_ahead(pose) < _BLOCKED_M
        self._recovery.watch(action, speed, yaw_rate, blocked=blocked)
        return np.array(action, np.float32)

    def _follow_drift(self, pose: Pose) -> None:
        """Update the drift estimate; call it once per period."""
        before, self._before = self._before, pose
        if before is None:
            return
        dx, dy = pose.x - before.x, pose.y - before.y
        going = math.hypot(dx, dy) / PERIOD_S > 0.2 * self._traits.body.top_speed_mps
        now = math.remainder(math.atan2(dy, dx) - pose.heading, math.tau) if going else 0.0
        if abs(now) > math.pi / 3:  # The vehicle moves backwards, or a person moved it.
            now = 0.0
        self._drift += (now - self._drift) * PERIOD_S / _DRIFT_S

    def _steering(self, angle: float, distance: float, speed: float, yaw_rate: float) -> float:
        """Steering, -1 (left) to 1, to a point at an angle from the heading, rad."""
        traits = self._traits
        fast = max(speed, 0.3 * traits.body.top_speed_mps)
        # Curvature of the circle to the target, 1/m. Targets behind count as being to the side.
        side = math.sin(angle) if abs(angle) < math.pi / 2 else math.copysign(1.0, angle)
        curvature = 2 * side / distance
        match traits.drive:
            case "wheels":
                return _clipped(-curvature / traits.turn)
            case "tracks":
                rate = _ABOUT_RATE * angle if abs(angle) > _ABOUT else fast * curvature
                # Tracks slip by an unknown amount, so the missing rate of turn is fed back.
                value = (1.5 * rate - 0.5 * yaw_rate) / traits.turn
                return _clipped(-(value + traits.dead * _clipped(rate / _STICKING)))
            case "rudder":
                rate = 1.6 * math.remainder(angle - self._drift, math.tau)
                return _clipped(-(2.0 * rate - 1.0 * yaw_rate) / (traits.turn * fast))

    def _room_ahead(self, pose: Pose) -> float:
        """Clearance at `_BLOCKED_M` ahead of the nose, m."""
        reach = self._traits.body.nose_m + _BLOCKED_M
        nose = pose.x + reach * math.cos(pose.heading), pose.y + reach * math.sin(pose.heading)
        return float(self._obstacles.distance(np.array([nose]))[0])

    def _soon(self, pose: Pose, speed: float, yaw_rate: float) -> Pose:
        """Return the predicted pose at the time when the current action takes effect."""
        ahead = speed * _REACTION_S
        heading = pose.heading + yaw_rate * _REACTION_S / 2
        return Pose(
            pose.x + ahead * math.cos(heading),
            pose.y + ahead * math.sin(heading),
            pose.heading + yaw_rate * _REACTION_S,
        )

    def _driven(
        self, steering: float, spot: Spot, angle: float, speed: float
    ) -> tuple[float, float]:
        """Steering and throttle for driving forward."""
        traits = self._traits
        here = self.path.index(spot.station)
        wanted = float(self.speeds[here])
        # Drive slower with less room than planned, and with a wrong heading.
        room = float(self.path.clearance[here]) - abs(spot.lateral) - traits.half_width_m
        if room < traits.margin_m:
            wanted *= 0.5 + 0.5 * max(room, 0.0) / traits.margin_m
        slowest = 0.1 if traits.drive == "tracks" else 0.4
        wanted *= max(math.cos(angle), slowest)
        fastest = traits.body.top_speed_mps
        throttle = wanted / fastest + _SPEED_GAIN * (wanted - speed) / fastest
        throttle = max(traits.least_throttle, min(1.0, throttle))
        if traits.drive == "tracks":  # Saturating one track would prevent the turn.
            throttle = min(throttle, 1.0 - abs(steering))
        return steering, throttle
