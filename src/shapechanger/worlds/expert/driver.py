"""Differences of directions."""

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

__all__ = ["CourseExpert", "Pursuit", "ThreeWay", "wrap_angle"]


def wrap_angle(angle: float) -> float:
    """The same direction as an angle from -pi to pi, rad."""
    return math.remainder(angle, 2 * math.pi)


DRIFT_S: Final = 0.8
"""Time over which a drift is averaged: turns come and go faster, the current stays."""

STICKING: Final = 0.1
"""Rate of turn from which on a tank is given all of what its tracks stick by, rad/s; less below, or
it would twitch where it goes straight on."""

ABOUT: Final = 0.9
"""Angle to its target, rad, from which on a tank turns on the spot."""

ABOUT_RATE: Final = 2.5
"""Rate of that turn over the angle, 1/s: friction holds a tank that turns about half-heartedly."""


class Pursuit:
    """The steering of one vehicle.

    Args:
        traits: How it is driven.
        period_s: Time from one action to the next, s.
    """

    def __init__(self, traits: Traits, period_s: float) -> None:
        self._traits = traits
        self._period_s = period_s
        self._before: Pose | None = None
        self._drift = 0.0

    def reset(self) -> None:
        """Forget how it has moved."""
        self._before, self._drift = None, 0.0

    def moved(self, pose: Pose) -> None:
        """Hear where the vehicle is, once a period, to learn how it drifts."""
        before, self._before = self._before, pose
        if before is None:
            return
        dx, dy = pose.x - before.x, pose.y - before.y
        going = math.hypot(dx, dy) / self._period_s > 0.2 * self._traits.top_speed
        now = wrap_angle(math.atan2(dy, dx) - pose.heading) if going else 0.0
        if abs(now) > math.pi / 3:  # It goes astern, or was moved.
            now = 0.0
        self._drift += (now - self._drift) * self._period_s / DRIFT_S

    def look(self, speed: float) -> float:
        """How far ahead on the path to aim, m, at a speed in m/s."""
        return self._traits.look_m + self._traits.look_s * max(speed, 0.0)

    def steering(
        self, pose: Pose, speed: float, yaw_rate: float, target: tuple[float, float]
    ) -> float:
        """The steering that leads to a point, from -1, left, to 1.

        Args:
            pose: Where the vehicle is.
            speed: Along its heading, m/s.
            yaw_rate: Counter-clockwise, rad/s.
            target: x and y, m.
        """
        dx, dy = target[0] - pose.x, target[1] - pose.y
        distance = max(math.hypot(dx, dy), 0.1)
        angle = wrap_angle(math.atan2(dy, dx) - pose.heading)
        match self._traits.drive:
            case "wheels":
                return self._clipped(-self._curvature(angle, distance) / self._traits.turn)
            case "tracks":
                rate = max(speed, 0.3 * self._traits.top_speed) * self._curvature(angle, distance)
                if abs(angle) > ABOUT:
                    rate = ABOUT_RATE * angle
                # Tracks slip by as much as the floor likes, so what is missing is added.
                value = (1.5 * rate - 0.5 * yaw_rate) / self._traits.turn
                value += self._traits.dead * max(-1.0, min(1.0, rate / STICKING))
                return self._clipped(-value)
            case "rudder":
                angle = wrap_angle(angle - self._drift)
                rate = 1.6 * angle
                water = max(speed, 0.3 * self._traits.top_speed)
                return self._clipped(-(2.0 * rate - 1.0 * yaw_rate) / (self._traits.turn * water))

    def _curvature(self, angle: float, distance: float) -> float:
        """Of the circle to the target, 1/m; one behind is turned to as tightly as one abeam."""
        side = math.sin(angle) if abs(angle) < math.pi / 2 else math.copysign(1.0, angle)
        return 2 * side / distance

    @staticmethod
    def _clipped(value: float) -> float:
        return max(-1.0, min(1.0, value))


class ThreeWay:
    """Gives each side its share of time.

    What a step steers too much or too little is made up for by the next ones, as in a sigma-delta
    modulator of first order (H. Inose, Y. Yasuda, "A unity bit coding method by negative
    feedback", Proceedings of the IEEE 51, 1963).
    """

    def __init__(self) -> None:
        self._owed = 0.0

    def reset(self) -> None:
        """Owe nothing."""
        self._owed = 0.0

    def step(self, steering: float) -> float:
        """-1, 0 or 1, whose mean over some steps is the steering that was asked for."""
        self._owed += steering
        given = float(max(-1, min(1, round(self._owed))))
        self._owed = max(-1.0, min(1.0, self._owed - given))
        return given


SPEED_GAIN: Final = 1.5
"""Throttle for a speed that is missing, as a multiple of the share of the top speed."""

REACTION_S: Final = 0.15
"""Time from an action to its effect: the expert looks at where the vehicle will be by then."""

ASIDE: Final = 0.7
"""Angle to its target, rad, from which on a vehicle has to turn before it can go on."""

BLOCKED_M: Final = 0.15
"""Room before its nose that is too little for that."""


class CourseExpert:
    """Drives one vehicle round one course, along a path planned beforehand.

    Args:
        course: Where.
        vehicle: Name of the vehicle: "car", "tank", "truck" or "boat".
        seed: Of how it gets away from walls.
        levels: "continuous", or "three" for a steering that knows only left, straight on, right.
        period_s: Time from one action to the next, s.
        path: The path, where it is known already.

    Attributes:
        path: What it follows.
        speeds: (N,) how fast each point of it is driven, m/s.

    Raises:
        UnknownName: No expert knows the vehicle.
        WorldError: It does not get round the course.
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
        """Whether it is getting away from something."""
        return self._recovery.active

    def reset(self, pose: Pose) -> None:
        """Begin at a pose."""
        self._station = self.path.nearest(pose.x, pose.y).station
        self._pursuit.reset()
        self._recovery.reset()
        if self._three_way:
            self._three_way.reset()

    def act(self, pose: Pose, speed: float, yaw_rate: float = 0.0) -> NDArray[np.float32]:
        """What to do now.

        Args:
            pose: Where the vehicle is.
            speed: Along its heading, m/s.
            yaw_rate: Counter-clockwise seen from above, rad/s.

        Returns:
            (2,) steering and throttle, from -1 to 1; -1 steers to the left.
        """
        if self._station is None:
            self.reset(pose)
        self._pursuit.moved(pose)
        soon = self._soon(pose, speed, yaw_rate)
        spot = self.path.nearest(soon.x, soon.y, self._station)
        self._station = spot.station
        look = self._pursuit.look(speed)
        target = self.path.ahead(spot.station, look)
        angle = wrap_angle(math.atan2(target[1] - soon.y, target[0] - soon.x) - soon.heading)
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
        """Room before the vehicle's nose, m."""
        reach = self._traits.nose_m + BLOCKED_M
        nose = (
            pose.x + reach * math.cos(pose.heading),
            pose.y + reach * math.sin(pose.heading),
        )
        return float(self._obstacles.distance(np.array([nose]))[0])

    def _soon(self, pose: Pose, speed: float, yaw_rate: float) -> Pose:
        """Where the vehicle will be when an action of now has its effect."""
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
        """Steering and throttle while it goes forward."""
        traits = self._traits
        here = self.path.index(station)
        wanted = float(self.speeds[here])
        # Off its line it has less room than was planned with, and turned away it must come round.
        room = float(self.path.clearance[here]) - abs(lateral) - traits.half_width_m
        if room < traits.margin_m:
            wanted *= 0.5 + 0.5 * max(room, 0.0) / traits.margin_m
        slowest = 0.1 if traits.drive == "tracks" else 0.4
        wanted *= max(math.cos(angle), slowest)
        throttle = wanted / traits.top_speed
        throttle += SPEED_GAIN * (wanted - speed) / traits.top_speed
        throttle = max(traits.least_throttle, min(1.0, throttle))
        if traits.drive == "tracks":  # Else one side would be cut off, and it would not turn.
            throttle = min(throttle, 1.0 - abs(steering))
        return steering, throttle
