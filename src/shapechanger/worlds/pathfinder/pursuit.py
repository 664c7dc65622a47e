"""Which steering leads a vehicle to a point ahead of it.

Pure pursuit: R. C. Coulter, "Implementation of the Pure Pursuit Path Tracking Algorithm",
CMU-RI-TR-92-01 (1992): the circle through the vehicle, along its heading, and through a point at
distance L and angle a has the curvature 2 sin(a) / L. A boat slides, so it does not go where it
points; it aims like a ship that follows a line of sight (T. I. Fossen, "Handbook of Marine Craft
Hydrodynamics and Motion Control", 2011, chapter 10), with its drift taken off.
"""

from __future__ import annotations

import math
from typing import Final

from shapechanger.worlds.pathfinder.angles import wrapped
from shapechanger.worlds.pathfinder.traits import Traits
from shapechanger.worlds.world import Pose

__all__ = ["Pursuit"]

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
        now = wrapped(math.atan2(dy, dx) - pose.heading) if going else 0.0
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
        angle = wrapped(math.atan2(dy, dx) - pose.heading)
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
                angle = wrapped(angle - self._drift)
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
