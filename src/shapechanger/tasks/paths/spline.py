"""A cubic spline through points: what a recording is between its samples.

Formulas and names as in Press et al., Numerical Recipes, 3rd edition (2007), sections 2.4 and 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shapechanger.tasks.paths.path import Points, Times

__all__ = ["Spline"]


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """Cubic pieces that meet with the same velocity and acceleration; `through` makes one.

    Attributes:
        knots: Times of the points, s, increasing from 0, shape (n,), with n at least 3.
        points: m, shape (n, 3).
        bends: Accelerations at the points, m/s², shape (n, 3); in between they change linearly.
    """

    knots: Times = field(repr=False)
    points: Points = field(repr=False)
    bends: Points = field(repr=False)

    @classmethod
    def through(cls, knots: Times, points: Points, periodic: bool) -> Spline:
        """The smoothest curve through points.

        Args:
            knots: Their times, s, increasing from 0, shape (n,), with n at least 3.
            points: m, shape (n, 3). Of a periodic spline the last is the first.
            periodic: Whether velocity and acceleration are the same at both ends, as of a closed
                path; otherwise both ends have no acceleration ("natural").
        """
        knots, points = knots.copy(), points.copy()
        bends = _bends(knots, points, periodic)
        for array in (knots, points, bends):
            array.setflags(write=False)
        return cls(knots, points, bends)

    def derivative(self, t: Times, order: int) -> Points:
        """Position, velocity or acceleration, as `Motion` says."""
        piece = (np.searchsorted(self.knots, t, side="right") - 1).clip(0, len(self.knots) - 2)
        h = (self.knots[piece + 1] - self.knots[piece])[:, None]
        b = (t - self.knots[piece])[:, None] / h  # How much of the piece is over, 0 to 1.
        a = 1.0 - b
        y0, y1 = self.points[piece], self.points[piece + 1]
        m0, m1 = self.bends[piece], self.bends[piece + 1]
        if order == 0:
            return a * y0 + b * y1 + ((a**3 - a) * m0 + (b**3 - b) * m1) * h**2 / 6.0
        if order == 1:
            return (y1 - y0) / h + ((3.0 * b**2 - 1.0) * m1 - (3.0 * a**2 - 1.0) * m0) * h / 6.0
        return a * m0 + b * m1


def _bends(knots: Times, points: Points, periodic: bool) -> Points:
    """Accelerations at the knots with which the pieces meet at one velocity, m/s², shape (n, 3).

    Inside, h[i-1] m[i-1] + 2 (h[i-1] + h[i]) m[i] + h[i] m[i+1] = 6 (slope[i] - slope[i-1]). The
    accelerations at both ends are one unknown: 0 in a natural spline; in a periodic one the same
    equation holds across the seam, where all others depend on the unknown linearly.
    """
    h = np.diff(knots)
    slopes = np.diff(points, axis=0) / h[:, None]
    right = np.zeros((len(h) - 1, 4))  # Three of the points, one of the unknown at the ends.
    right[:, :3] = 6.0 * np.diff(slopes, axis=0)
    right[0, 3] -= h[0]
    right[-1, 3] -= h[-1]  # Of three points the inner one has the unknown at both sides.
    solved = _tridiagonal(2.0 * (h[:-1] + h[1:]), h[1:-1], right)
    alone, influence = solved[:, :3], solved[:, 3:]
    end = np.zeros(3)
    if periodic:
        seam = 6.0 * (slopes[0] - slopes[-1]) - h[0] * alone[0] - h[-1] * alone[-1]
        end = seam / (2.0 * (h[0] + h[-1]) + h[0] * influence[0] + h[-1] * influence[-1])
    return np.vstack([end, alone + influence * end, end])


def _tridiagonal(
    diagonal: NDArray[np.float64], beside: NDArray[np.float64], right: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solve symmetric equations in which each unknown knows only its neighbours.

    Args:
        diagonal: Shape (n,); each larger than the numbers beside it together.
        beside: Between an unknown and the next, shape (n - 1,).
        right: Right-hand sides, shape (n, k).

    Returns:
        Shape (n, k).
    """
    pivots, solved = diagonal.copy(), right.copy()
    for i in range(1, len(pivots)):
        factor = beside[i - 1] / pivots[i - 1]
        pivots[i] -= factor * beside[i - 1]
        solved[i] -= factor * solved[i - 1]
    solved[-1] /= pivots[-1]
    for i in range(len(pivots) - 2, -1, -1):
        solved[i] = (solved[i] - beside[i] * solved[i + 1]) / pivots[i]
    return solved
