"""Closed lines as arrays of points, shape (n, 2), in metres: the last is joined to the first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "arcs",
    "at",
    "length",
    "normals",
    "resampled",
    "smoothed",
    "spaced",
    "tangent_radii",
    "turns",
]

Points = NDArray[np.float64]


def length(line: Points) -> float:
    """Once round, m."""
    return float(arcs(line)[-1])


def arcs(line: Points) -> NDArray[np.float64]:
    """Distance along the line to each point and, as the last number, once round; shape (n + 1,)."""
    steps = np.diff(line, axis=0, append=line[:1])
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])


def at(line: NDArray[np.float64], knots: NDArray[np.float64], s: NDArray[np.float64]) -> Points:
    """Values at distances `s` along a closed line, between its points linearly.

    Args:
        line: Values at the points, shape (n, k).
        knots: What `arcs` says of the points, shape (n + 1,).
        s: Distances, m, of any size: they wrap round. Shape (m,).

    Returns:
        Shape (m, k).
    """
    whole = np.concatenate([line, line[:1]])
    s = np.mod(s, knots[-1])
    columns = [np.interp(s, knots, whole[:, k]) for k in range(whole.shape[1])]
    return np.stack(columns, axis=1)


def resampled(line: Points, spacing: float) -> Points:
    """The line by points that are about `spacing` apart: all the same distance, as the crow flies.

    Equal distances along a bent line are unequal as the crow flies; two corrections make the rest
    of the difference smaller than a part in a thousand on the bends that vehicles can drive.
    """
    knots = arcs(line)
    n = max(8, round(float(knots[-1]) / spacing))
    s = spaced(float(knots[-1]), n)
    for _ in range(2):
        chords = arcs(at(line, knots, s))
        s = np.interp(spaced(float(chords[-1]), n), chords, np.append(s, knots[-1]))
    return at(line, knots, s)


def spaced(length_m: float, n: int) -> NDArray[np.float64]:
    """So many distances from 0 on, evenly over a closed line of that length, m, shape (n,)."""
    return np.arange(n, dtype=np.float64) * (length_m / n)


def smoothed(values: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Columns of a closed line, blurred by a bell curve of `sigma` points. Shape as given."""
    n = len(values)
    waves = np.exp(-2.0 * (np.pi * sigma * np.fft.rfftfreq(n)) ** 2)
    spectrum = np.fft.rfft(values, axis=0)
    return np.fft.irfft(spectrum * waves.reshape(-1, *[1] * (values.ndim - 1)), n=n, axis=0)


def normals(line: Points) -> Points:
    """Unit vectors to the left of the line at its points, shape (n, 2)."""
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    ahead /= np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    return np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)


def turns(line: Points) -> NDArray[np.float64]:
    """By how much the line turns to the left at each point, rad, shape (n,)."""
    ahead = np.roll(line, -1, axis=0) - line
    back = np.roll(ahead, 1, axis=0)
    return np.arctan2(
        back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1)
    )


def tangent_radii(line: Points) -> NDArray[np.float64]:
    """How far a lane can spread to both sides of each point before it meets itself, m, shape (n,).

    It is the radius of the smallest circle that touches the line at the point and goes through
    another: small in a tight bend, and where another part of the line comes near. Gonzalez and
    Maddocks call its like the global radius of curvature (PNAS 96, 1999, pages 4769-4773).
    """
    x, y = line[:, 0] - line[:, :1], line[:, 1] - line[:, 1:]
    left = normals(line)
    squared = x * x + y * y
    across = np.abs(x * left[:, :1] + y * left[:, 1:])
    np.fill_diagonal(across, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        radii = np.where(across > 1e-9, squared / (2.0 * across), np.inf)
    return radii.min(axis=1)
