"""A closed line that knows where on it a point is."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["ClosedLine", "Spot"]

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
            which = np.arange(len(self.points))
        else:
            middle = self.index(hint)
            which = np.arange(middle - self._window, middle + self._window + 1) % len(self.points)
        start, step, squared = self.points[which], self._steps[which], self._squared[which]
        away = np.array((x, y)) - start
        share = np.clip(np.einsum("ij,ij->i", away, step) / squared, 0.0, 1.0)
        off = away - share[:, None] * step
        best = int(np.argmin(np.einsum("ij,ij->i", off, off)))
        size = float(np.sqrt(squared[best]))
        station = float(self.stations[which[best]] + share[best] * size) % self.length
        cross = float(step[best, 0] * away[best, 1] - step[best, 1] * away[best, 0])
        return Spot(station, float(np.copysign(np.hypot(off[best, 0], off[best, 1]), cross)))

    def ahead_by(self, start: float, end: float) -> float:
        """The shorter way along the line from one station to another, m; backward is negative.

        Args:
            start: m.
            end: m.
        """
        return (end - start + self.length / 2) % self.length - self.length / 2
