"""A closed line that knows where on it a point is."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course

__all__ = ["ClosedLine", "CourseProgress", "Spot"]

WINDOW_M: Final = 2.0
"""How far along the line from its last spot something is looked for. Legs of a course that run next
to each other are much farther apart along the line, so none is taken for the other."""


class Spot(NamedTuple):
    """Where something is, seen from a line.

    Attributes:
        station: Distance along the line, m, from 0 to its length.
        lateral: Distance from the line, m; to the left is positive.
    """

    station: float
    lateral: float


class ClosedLine:
    """Straight pieces between points, the last of which leads back to the first.

    Args:
        points: (N, 2), m, no two neighbours alike.
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        self.points = points
        self._steps = np.roll(points, -1, axis=0) - points
        self._squared = np.einsum("ij,ij->i", self._steps, self._steps)
        lengths = np.sqrt(self._squared)
        self.stations: NDArray[np.float64] = np.concatenate(([0.0], np.cumsum(lengths)[:-1]))
        self.length = float(lengths.sum())
        self._window = int(np.ceil(WINDOW_M / (self.length / len(points))))
        # Going on beyond both ends by a window, so that each window is a slice.
        around = np.arange(-self._window, len(points) + self._window) % len(points)
        self._around = np.column_stack((points, self._steps, self._squared))[around].T.copy()

    def index(self, station: float) -> int:
        """Number of the point that a station lies at or behind.

        Args:
            station: m; any number, for stations go on round and round.
        """
        return int(np.searchsorted(self.stations, station % self.length, side="right")) - 1

    def at(self, station: float) -> tuple[float, float]:
        """The point at a station.

        Args:
            station: m; any number, for stations go on round and round.
        """
        i = self.index(station)
        share = (station % self.length - self.stations[i]) / np.sqrt(self._squared[i])
        x, y = self.points[i] + share * self._steps[i]
        return float(x), float(y)

    def nearest(self, x: float, y: float, hint: float | None = None) -> Spot:
        """The spot of the line that is nearest to a point.

        Args:
            x: m.
            y: m.
            hint: Station near which to look, m; None looks everywhere.
        """
        if hint is None:
            first, count = 0, len(self.points)
        else:
            first, count = self.index(hint) - self._window, 2 * self._window + 1
        # This is asked at each step of each simulation, so it makes few and small arrays.
        near = self._around[:, first + self._window : first + self._window + count]
        start_x, start_y, step_x, step_y, squared = near
        away_x, away_y = x - start_x, y - start_y
        share = (away_x * step_x + away_y * step_y) / squared
        np.maximum(np.minimum(share, 1.0, out=share), 0.0, out=share)
        off_x, off_y = away_x - share * step_x, away_y - share * step_y
        best = int((off_x * off_x + off_y * off_y).argmin())
        behind = self.stations[(first + best) % len(self.points)]
        station = float(behind + share[best] * np.sqrt(squared[best])) % self.length
        cross = float(step_x[best] * away_y[best] - step_y[best] * away_x[best])
        return Spot(station, math.copysign(math.hypot(off_x[best], off_y[best]), cross))

    def ahead_by(self, start: float, end: float) -> float:
        """The shorter way along the line from one station to another, m; backward is negative.

        Args:
            start: m.
            end: m.
        """
        return (end - start + self.length / 2) % self.length - self.length / 2


class CourseProgress:
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
