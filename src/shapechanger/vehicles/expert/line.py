"""Closed lines with stations, and progress along a course."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.course import Course

# Distance along the line, m, within which a nearest spot is searched around a hint. Parallel legs
# of a course are much farther apart along the line, so none is mistaken for another.
_WINDOW_M: Final = 2.0


class Spot(NamedTuple):
    """Position relative to a line.

    Attributes:
        station: Distance along the line, m, from 0 to its length.
        lateral: Distance from the line, m; positive to the left.
    """

    station: float
    lateral: float


class ClosedLine:
    """Closed polyline; the last point is joined to the first.

    Args:
        points: Points, m, (N, 2); neighbours differ.

    Attributes:
        points: The points.
        stations: Distance of each point along the line, m, (N,).
        length: Length of the line, m.
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        self.points = points
        self._steps = np.roll(points, -1, axis=0) - points
        self._squared = np.einsum("ij,ij->i", self._steps, self._steps)
        lengths = np.sqrt(self._squared)
        self.stations: NDArray[np.float64] = np.concatenate(([0.0], np.cumsum(lengths)[:-1]))
        self.length = float(lengths.sum())
        self._window = int(np.ceil(_WINDOW_M / (self.length / len(points))))
        # Extended beyond both ends by a window, so that each window is a slice.
        around = np.arange(-self._window, len(points) + self._window) % len(points)
        self._around = np.column_stack((points, self._steps, self._squared))[around].T.copy()

    def index(self, station: float) -> int:
        """Index of the last point at or before a station, m, which wraps around."""
        return int(np.searchsorted(self.stations, station % self.length, side="right")) - 1

    def at(self, station: float) -> tuple[float, float]:
        """Point, m, at a station, m, which wraps around."""
        i = self.index(station)
        share = (station % self.length - self.stations[i]) / np.sqrt(self._squared[i])
        x, y = self.points[i] + share * self._steps[i]
        return float(x), float(y)

    def nearest(self, x: float, y: float, hint: float | None = None) -> Spot:
        """Nearest spot of the line to a point, m; with a hint, near that station only."""
        if hint is None:
            first, count = 0, len(self.points)
        else:
            first, count = self.index(hint) - self._window, 2 * self._window + 1
        # Called at each simulation step, so it makes few and small arrays.
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
        """Shorter way along the line from one station to another, m; backward is negative."""
        return (end - start + self.length / 2) % self.length - self.length / 2


class CourseProgress:
    """Net distance of a vehicle along the route of a course.

    It keeps counting lap after lap; driving backward counts down. After moving the vehicle by more
    than 2 m call `reset`.
    """

    def __init__(self, course: Course) -> None:
        self._line = ClosedLine(course.route)
        self._spot = Spot(0.0, 0.0)
        self._metres = 0.0

    def reset(self, x: float, y: float) -> None:
        """Start at a point, m."""
        self._spot = self._line.nearest(x, y)
        self._metres = 0.0

    def update(self, x: float, y: float) -> float:
        """Move the vehicle to a point, and return the net distance since the last reset, m."""
        spot = self._line.nearest(x, y, self._spot.station)
        self._metres += self._line.ahead_by(self._spot.station, spot.station)
        self._spot = spot
        return self._metres
