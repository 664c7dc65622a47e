"""How far a vehicle has got round a course."""

from __future__ import annotations

from shapechanger.worlds.course import Course
from shapechanger.worlds.pathfinder.line import ClosedLine, Spot

__all__ = ["Progress"]


class Progress:
    """Net metres along the middle of the lane.

    They go on counting lap after lap, and driving backward counts them down. A vehicle that is
    moved by more than 2 m needs a `reset`.

    Args:
        course: What the vehicle drives round.
    """

    def __init__(self, course: Course) -> None:
        self._line = ClosedLine(course.route)
        self._spot = Spot(0.0, 0.0)
        self._metres = 0.0

    @property
    def metres(self) -> float:
        """Net progress since the last reset, m."""
        return self._metres

    @property
    def spot(self) -> Spot:
        """Where along the lane the vehicle was last."""
        return self._spot

    def reset(self, x: float, y: float) -> None:
        """Begin at a point, m."""
        self._spot = self._line.nearest(x, y)
        self._metres = 0.0

    def update(self, x: float, y: float) -> float:
        """Net progress since the last reset, m, now that the vehicle is at a point, m."""
        spot = self._line.nearest(x, y, self._spot.station)
        self._metres += self._line.ahead_by(self._spot.station, spot.station)
        self._spot = spot
        return self._metres
