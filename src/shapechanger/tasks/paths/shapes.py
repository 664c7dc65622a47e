"""Circle, figure eight, line and a curve in three dimensions: closed, smooth, and known exactly.

Where nothing else is asked for they lie before the pulp of a bent index finger, in the plane in
which it bends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import PathError
from shapechanger.tasks.paths.path import (
    FASTEST_MPS,
    FingertipPath,
    Points,
    Times,
    Vector,
    finite,
    positive,
    vector,
)

__all__ = ["Harmonics", "circle", "curve_3d", "figure_eight", "line"]


@dataclass(frozen=True, slots=True)
class Harmonics:
    """A Fourier series.

    At the angle a = 2π `hz` t + `phase` the point is at
    `centre` + Σ (cos(k a) `cosines[k - 1]` + sin(k a) `sines[k - 1]`), with k = 1, 2, …

    Attributes:
        hz: Rounds in a second, above 0.
        phase: Where on the round it begins, rad.
        centre: The middle over time, m.
        cosines: What goes with the cosine of each multiple of the angle, m.
        sines: What goes with its sine, m; as many.
    """

    hz: float
    phase: float
    centre: Vector
    cosines: tuple[Vector, ...]
    sines: tuple[Vector, ...]

    def derivative(self, t: Times, order: int) -> Points:
        """Position, velocity or acceleration, as `Motion` says, at times of any size and sign."""
        multiples = np.arange(1.0, len(self.cosines) + 1.0)
        rates = math.tau * self.hz * multiples  # rad/s, shape (k,).
        # Each derivative of a sine or cosine is a quarter of a turn ahead, and grows by the rate.
        angles = rates * t[:, None] + self.phase * multiples + order * math.pi / 2.0
        grown = rates**order
        points = (grown * np.cos(angles)) @ np.array(self.cosines)
        points += (grown * np.sin(angles)) @ np.array(self.sines)
        if order == 0:
            points += self.centre
        return points


_CENTRE: Final = (0.050, 0.0, -0.045)
_RADIAL: Final = (0.0, 1.0, 0.0)
_NOWHERE: Final = (0.0, 0.0, 0.0)

# Of each of three axes at right angles, shape (3,).
_Axes = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def circle(
    radius: float = 0.012,
    centre: Vector = _CENTRE,
    hz: float = 0.5,
    normal: Vector = _RADIAL,
    phase: float = 0.0,
) -> FingertipPath:
    """A circle, at a steady speed.

    It begins on its distal side (on its dorsal side, if `normal` points along x) and goes round
    `normal` as a right hand's fingers go round its thumb: with the usual one palmar first.

    Args:
        radius: m, above 0.
        centre: m, in the frame of the finger.
        hz: Rounds in a second, above 0.
        normal: At a right angle to its plane; of any length but 0.
        phase: How much further on it begins, rad.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    radius = positive("The radius of a circle", radius)
    along, across, _ = _axes(normal)
    return _closed("circle", hz, phase, centre, [radius * along], [radius * across])


def figure_eight(
    size: float = 0.024,
    centre: Vector = _CENTRE,
    hz: float = 0.5,
    normal: Vector = _RADIAL,
    phase: float = 0.0,
) -> FingertipPath:
    """A figure eight that lies on its side: the lemniscate of Gerono.

    It begins where it crosses itself, towards its distal loop. Seen from where `normal` points to,
    it goes round the distal loop clockwise and round the other one counter-clockwise.

    Args:
        size: Its length along x, or as near to x as its plane allows, m, above 0; it is half as
            wide.
        centre: Where it crosses itself, m, in the frame of the finger.
        hz: Rounds in a second, above 0: both loops are one round.
        normal: At a right angle to its plane; of any length but 0.
        phase: How much further on it begins, rad.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    size = positive("The size of a figure eight", size)
    along, across, _ = _axes(normal)
    sines = [size / 2.0 * along, size / 4.0 * across]
    return _closed("figure eight", hz, phase, centre, [], sines)


def line(
    start: Vector = (0.060, 0.0, -0.040),
    end: Vector = (0.040, 0.0, -0.050),
    hz: float = 0.5,
) -> FingertipPath:
    """A straight line, there and back, as a pendulum goes: it rests at both ends for a moment.

    Args:
        start: Where it begins, m, in the frame of the finger.
        end: Where it turns, m; elsewhere than `start`.
        hz: How often it goes there and back in a second, above 0.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    first = np.array(vector("The start of a line", start))
    last = np.array(vector("The end of a line", end))
    if np.array_equal(first, last):
        raise PathError(f"A line must end elsewhere than it starts, got {start!r} twice.")
    middle = first / 2.0 + last / 2.0
    return _closed("line", hz, 0.0, _vector(middle), [first - middle], [])


def curve_3d(
    size: float = 0.024,
    depth: float = 0.008,
    centre: Vector = _CENTRE,
    hz: float = 0.5,
    normal: Vector = _RADIAL,
    phase: float = 0.0,
) -> FingertipPath:
    """A figure eight that is bent out of its plane: a Lissajous curve in three dimensions.

    It is `figure_eight`, with both loops bent towards `normal` and the crossing away from it.

    Args:
        size: Its length along x, or as near to x as its plane allows, m, above 0; it is half as
            wide.
        depth: How far it reaches along `normal`, m, above 0: half of it to each side.
        centre: The middle, m, in the frame of the finger.
        hz: Rounds in a second, above 0: both loops are one round.
        normal: At a right angle to the plane out of which it is bent; of any length but 0.
        phase: How much further on it begins, rad.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    size = positive("The size of a curve", size)
    depth = positive("The depth of a curve", depth)
    along, across, out = _axes(normal)
    sines = [size / 2.0 * along, size / 4.0 * across]
    cosines = [np.zeros(3), -depth / 2.0 * out]
    return _closed("curve", hz, phase, centre, cosines, sines)


def _axes(normal: Vector) -> _Axes:
    """Along, across and out of the plane: right-handed, and along is as near to x as it can be."""
    out: NDArray[np.float64] = np.array(vector("The normal of a plane", normal))
    if not out.any():
        raise PathError("The normal of a plane must not be (0, 0, 0): it has no direction.")
    out /= np.abs(out).max()  # First, as the square of a small number may be 0.
    out /= np.linalg.norm(out)
    along: NDArray[np.float64] = np.array([1.0, 0.0, 0.0])
    along -= out[0] * out
    if np.linalg.norm(along) < 1e-6:
        along = np.array([0.0, 0.0, 1.0])
        along -= out[2] * out
    along /= np.linalg.norm(along)
    return along, np.cross(out, along), out


def _closed(
    what: str,
    hz: float,
    phase: float,
    centre: Vector,
    cosines: list[NDArray[np.float64]],
    sines: list[NDArray[np.float64]],
) -> FingertipPath:
    """A path of oscillations, unless no finger is so fast."""
    n = max(len(cosines), len(sines))
    hz = positive(f"The hz of a {what}", hz)
    motion = Harmonics(
        hz=hz,
        phase=finite(f"The phase of a {what}", phase),
        centre=vector(f"The centre of a {what}", centre),
        cosines=_padded(cosines, n),
        sines=_padded(sines, n),
    )
    path = FingertipPath(motion, duration_s=1.0 / hz, closed=True)
    with np.errstate(over="ignore", invalid="ignore"):
        around = motion.derivative(np.linspace(0.0, path.duration_s, 721), 1)
        fastest = np.hypot(np.hypot(around[:, 0], around[:, 1]), around[:, 2]).max()
    if not fastest <= FASTEST_MPS:
        raise PathError(
            f"This {what} is as fast as {fastest:.3g} m/s, and no fingertip is faster than "
            f"{FASTEST_MPS:g} m/s: make it smaller, or hz lower."
        )
    return path


def _padded(vectors: list[NDArray[np.float64]], n: int) -> tuple[Vector, ...]:
    missing: list[Vector] = [_NOWHERE] * (n - len(vectors))
    return (*map(_vector, vectors), *missing)


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
