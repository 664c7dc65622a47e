"""A driver that knows the whole course."""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course
from shapechanger.worlds.pathfinder.angles import wrapped
from shapechanger.worlds.pathfinder.clearance import Obstacles
from shapechanger.worlds.pathfinder.pace import pace
from shapechanger.worlds.pathfinder.path import Path, plan_path_for
from shapechanger.worlds.pathfinder.pursuit import Pursuit
from shapechanger.worlds.pathfinder.recovery import Recovery
from shapechanger.worlds.pathfinder.three_way import ThreeWay
from shapechanger.worlds.pathfinder.traits import Traits, traits_of
from shapechanger.worlds.world import Pose

__all__ = ["Expert"]

SPEED_GAIN: Final = 1.5
"""Throttle for a speed that is missing, as a multiple of the share of the top speed."""

REACTION_S: Final = 0.15
"""Time from an action to its effect: the expert looks at where the vehicle will be by then."""

ASIDE: Final = 0.7
"""Angle to its target, rad, from which on a vehicle has to turn before it can go on."""

BLOCKED_M: Final = 0.15
"""Room before its nose that is too little for that."""


class Expert:
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
        path: Path | None = None,
    ) -> None:
        self._traits: Traits = traits_of(vehicle)
        self.path = path or plan_path_for(course, self._traits)
        self.speeds = pace(self.path, self._traits)
        self._obstacles = Obstacles(course)
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
        angle = wrapped(math.atan2(target[1] - soon.y, target[0] - soon.x) - soon.heading)
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
