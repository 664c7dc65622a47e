"""Driver that follows a path planned on the whole course.

The steering is pure pursuit: R. C. Coulter, "Implementation of the Pure Pursuit Path Tracking
Algorithm", CMU-RI-TR-92-01 (1992). The circle that is tangent to the vehicle's heading and passes
through a point at distance L and angle a has the curvature 2 sin(a) / L. A boat drifts, so it aims
like a ship on a line of sight (T. I. Fossen, "Handbook of Marine Craft Hydrodynamics and Motion
Control", 2011, chapter 10), with its drift angle subtracted.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course
from shapechanger.worlds.expert.lattice import ClearanceField
from shapechanger.worlds.expert.path import CoursePath, plan_path_for, speed_profile
from shapechanger.worlds.expert.recovery import Recovery
from shapechanger.worlds.expert.traits import Traits, traits_of
from shapechanger.worlds.world import Pose


def _wrap_angle(angle: float) -> float:
    """Equivalent angle from -pi to pi, rad."""
    return math.remainder(angle, 2 * math.pi)


DRIFT_S: Final = 0.8
"""Time constant of the drift average, s: longer than turns, so that the current remains."""

STICKING: Final = 0.1
"""Rate of turn, rad/s, from which a tank's full dead band is compensated; less below it, so that
it does not twitch on straights."""

ABOUT: Final = 0.9
"""Angle to the target, rad, above which a tank turns on the spot."""

ABOUT_RATE: Final = 2.5
"""Rate of that turn over the angle, 1/s; a slower turn gets stuck in friction."""


class Pursuit:
    """Steering towards a point ahead.

    Args:
        traits: Driving properties of the vehicle.
        period_s: Control period, s.
    """

    def __init__(self, traits: Traits, period_s: float) -> None:
        self._traits = traits
        self._period_s = period_s
        self._before: Pose | None = None
        self._drift = 0.0

    def reset(self) -> None:
        """Forget the drift."""
        self._before, self._drift = None, 0.0

    def moved(self, pose: Pose) -> None:
        """Update the drift estimate; call it once per period."""
        before, self._before = self._before, pose
        if before is None:
            return
        dx, dy = pose.x - before.x, pose.y - before.y
        going = math.hypot(dx, dy) / self._period_s > 0.2 * self._traits.top_speed
        now = _wrap_angle(math.atan2(dy, dx) - pose.heading) if going else 0.0
        if abs(now) > math.pi / 3:  # Astern, or moved by hand.
            now = 0.0
        self._drift += (now - self._drift) * self._period_s / DRIFT_S

    def look(self, speed: float) -> float:
        """Look-ahead distance, m, at a speed, m/s."""
        return self._traits.look_m + self._traits.look_s * max(speed, 0.0)

    def steering(
        self, pose: Pose, speed: float, yaw_rate: float, target: tuple[float, float]
    ) -> float:
        """Steering towards a point, from -1, left, to 1.

        Args:
            pose: Pose of the vehicle.
            speed: Speed along its heading, m/s.
            yaw_rate: Rate of turn, rad/s, counter-clockwise.
            target: x and y of the point, m.
        """
        dx, dy = target[0] - pose.x, target[1] - pose.y
        distance = max(math.hypot(dx, dy), 0.1)
        angle = _wrap_angle(math.atan2(dy, dx) - pose.heading)
        match self._traits.drive:
            case "wheels":
                return self._clipped(-self._curvature(angle, distance) / self._traits.turn)
            case "tracks":
                rate = max(speed, 0.3 * self._traits.top_speed) * self._curvature(angle, distance)
                if abs(angle) > ABOUT:
                    rate = ABOUT_RATE * angle
                # Tracks slip by an unknown amount, so the missing rate of turn is fed back.
                value = (1.5 * rate - 0.5 * yaw_rate) / self._traits.turn
                value += self._traits.dead * max(-1.0, min(1.0, rate / STICKING))
                return self._clipped(-value)
            case "rudder":
                angle = _wrap_angle(angle - self._drift)
                rate = 1.6 * angle
                water = max(speed, 0.3 * self._traits.top_speed)
                return self._clipped(-(2.0 * rate - 1.0 * yaw_rate) / (self._traits.turn * water))

    def _curvature(self, angle: float, distance: float) -> float:
        """Curvature of the circle to the target, 1/m; targets behind count as abeam."""
        side = math.sin(angle) if abs(angle) < math.pi / 2 else math.copysign(1.0, angle)
        return 2 * side / distance

    @staticmethod
    def _clipped(value: float) -> float:
        return max(-1.0, min(1.0, value))


class ThreeWay:
    """Steering for a vehicle that knows only left, straight on and right, as that of 2017.

    The error of each step is carried over to the next ones, as in a first-order sigma-delta
    modulator (H. Inose, Y. Yasuda, "A unity bit coding method by negative feedback", Proceedings of
    the IEEE 51, 1963).
    """

    def __init__(self) -> None:
        self._error = 0.0

    def reset(self) -> None:
        """Forget the error carried over."""
        self._error = 0.0

    def step(self, steering: float) -> float:
        """Quantize a steering to -1, 0 or 1, so that the mean over several steps is kept."""
        self._error += steering
        given = float(max(-1, min(1, round(self._error))))
        self._error = max(-1.0, min(1.0, self._error - given))
        return given


SPEED_GAIN: Final = 1.5
"""Gain of the throttle on the speed error, both relative to their maxima."""

REACTION_S: Final = 0.15
"""Delay from an action to its effect, s, over which the pose is predicted."""

ASIDE: Final = 0.7
"""Angle to the target, rad, above which a vehicle must turn before it can go on."""

BLOCKED_M: Final = 0.15
"""Clearance ahead of the nose, m, that is too small for that."""


class CourseExpert:
    """Drives a vehicle around a course, along a planned path.

    Args:
        course: The course.
        vehicle: Name of the vehicle: "car", "tank", "truck" or "boat".
        seed: Seed of the recovery manoeuvres.
        levels: "continuous", or "three" for steering with left, straight on and right only.
        period_s: Control period, s.
        path: The path, if it is already planned.

    Attributes:
        path: The path that it follows.
        speeds: Speed at each point of the path, m/s, (N,).

    Raises:
        UnknownName: If the vehicle is unknown.
        WorldError: If there is no path around the course.
    """

    def __init__(
        self,
        course: Course,
        vehicle: str,
        seed: int = 0,
        *,
        levels: Literal["continuous", "three"] = "continuous",
        period_s: float = 0.05,
        path: CoursePath | None = None,
    ) -> None:
        self._traits: Traits = traits_of(vehicle)
        self.path = path or plan_path_for(course, self._traits)
        self.speeds = speed_profile(self.path, self._traits)
        self._obstacles = ClearanceField(course)
        self._pursuit = Pursuit(self._traits, period_s)
        self._recovery = Recovery(self._traits, period_s, np.random.default_rng(seed))
        self._three_way = ThreeWay() if levels == "three" else None
        self._station: float | None = None

    @property
    def recovering(self) -> bool:
        """Return whether a recovery manoeuvre is active."""
        return self._recovery.active

    def reset(self, pose: Pose) -> None:
        """Start at a pose."""
        self._station = self.path.nearest(pose.x, pose.y).station
        self._pursuit.reset()
        self._recovery.reset()
        if self._three_way:
            self._three_way.reset()

    def act(self, pose: Pose, speed: float, yaw_rate: float = 0.0) -> NDArray[np.float32]:
        """Choose an action; call it once per period.

        Args:
            pose: Pose of the vehicle.
            speed: Speed along its heading, m/s.
            yaw_rate: Rate of turn, rad/s, counter-clockwise seen from above.

        Returns:
            Steering and throttle, from -1 to 1, (2,); -1 steers left.
        """
        if self._station is None:
            self.reset(pose)
        self._pursuit.moved(pose)
        soon = self._soon(pose, speed, yaw_rate)
        spot = self.path.nearest(soon.x, soon.y, self._station)
        self._station = spot.station
        look = self._pursuit.look(speed)
        target = self.path.ahead(spot.station, look)
        angle = _wrap_angle(math.atan2(target[1] - soon.y, target[0] - soon.x) - soon.heading)
        back = self._recovery.action(angle)
        if back is None:
            steering = self._pursuit.steering(soon, speed, yaw_rate, target)
            action = self._driven(steering, spot.station, spot.lateral, angle, speed)
        else:
            action = back
        blocked = abs(angle) > ASIDE and self._ahead(pose) < BLOCKED_M
        self._recovery.watch(action, speed, yaw_rate, blocked=blocked)
        if self._three_way:
            action = (self._three_way.step(action[0]), action[1])
        return np.array(action, np.float32)

    def _ahead(self, pose: Pose) -> float:
        """Clearance at `BLOCKED_M` ahead of the nose, m."""
        reach = self._traits.nose_m + BLOCKED_M
        nose = (
            pose.x + reach * math.cos(pose.heading),
            pose.y + reach * math.sin(pose.heading),
        )
        return float(self._obstacles.distance(np.array([nose]))[0])

    def _soon(self, pose: Pose, speed: float, yaw_rate: float) -> Pose:
        """Predicted pose when the current action takes effect."""
        ahead = speed * REACTION_S
        heading = pose.heading + yaw_rate * REACTION_S / 2
        return Pose(
            pose.x + ahead * math.cos(heading),
            pose.y + ahead * math.sin(heading),
            pose.heading + yaw_rate * REACTION_S,
        )

    def _driven(
        self, steering: float, station: float, lateral: float, angle: float, speed: float
    ) -> tuple[float, float]:
        """Steering and throttle for driving forward."""
        traits = self._traits
        here = self.path.index(station)
        wanted = float(self.speeds[here])
        # Off the path there is less room than planned, and a wrong heading must be corrected.
        room = float(self.path.clearance[here]) - abs(lateral) - traits.half_width_m
        if room < traits.margin_m:
            wanted *= 0.5 + 0.5 * max(room, 0.0) / traits.margin_m
        slowest = 0.1 if traits.drive == "tracks" else 0.4
        wanted *= max(math.cos(angle), slowest)
        throttle = wanted / traits.top_speed
        throttle += SPEED_GAIN * (wanted - speed) / traits.top_speed
        throttle = max(traits.least_throttle, min(1.0, throttle))
        if traits.drive == "tracks":  # Saturating one track would prevent the turn.
            throttle = min(throttle, 1.0 - abs(steering))
        return steering, throttle
