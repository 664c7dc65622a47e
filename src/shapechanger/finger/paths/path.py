"""Path of a point over time; circle, figure eight, line and a three-dimensional curve.

The shapes are closed, smooth and known exactly. By default they lie in front of the pulp of a bent
index finger, in the plane in which it bends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from numbers import Real
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import PathError
from shapechanger.finger.parameters import as_numbers

Vector = tuple[float, float, float]
"""x, y and z."""


def number(name: str, value: Any, *, above_zero: bool = False) -> float:
    """Return a finite number; raise PathError, with its name, for anything else."""
    found = float(value) if isinstance(value, Real) and value is not True else math.nan
    if value is False or not math.isfinite(found) or (above_zero and not found > 0.0):
        above = " above 0" if above_zero else ""
        raise PathError(f"{name} must be a finite number{above}, got {value!r}.")
    return found


positive: Final = partial(number, above_zero=True)


def vector(name: str, value: Any) -> Vector:
    """Return three finite numbers, of an array too; raise PathError, with their name, otherwise."""
    numbers = as_numbers(value)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise PathError(f"{name} must be three finite numbers (x, y, z), got {value!r}.")
    x, y, z = numbers.tolist()
    return x, y, z


Times = NDArray[np.float64]
"""Seconds, shape (n,)."""

Points = NDArray[np.float64]
"""Positions, m, or velocities, m/s, shape (n, 3)."""

CLOSED_M: Final = 1e-4
"""Largest distance between the two ends of a closed path, m."""


@dataclass(frozen=True, slots=True)
class FingertipPath:
    """Path that a fingertip follows; create it with the functions of this package.

    A closed path is periodic, also before 0 s. An open path begins at 0 s and ends at `duration_s`;
    before and after, the point rests at its ends.

    Attributes:
        position: Positions, m, shape (n, 3), at times from 0 to `duration_s`, s, shape (n,).
        duration_s: Period of a closed path, or duration of an open one, s, above 0; infinite for an
            endless function.
        closed: Whether it is periodic.
    """

    position: Callable[[Times], Points]
    duration_s: float
    closed: bool

    @property
    def period_s(self) -> float | None:
        """Period, s; None for an open path."""
        return self.duration_s if self.closed else None

    def at(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the position of the point.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Positions in the finger's frame, m, shape (..., 3).

        Raises:
            PathError: If a time is not finite, or a function returns no position for it.
        """
        times = np.asarray(t, dtype=np.float64)
        if not np.isfinite(times).all():
            raise PathError("Times of a path must be finite, got NaN or infinity.")
        flat = times.ravel()
        within = np.mod(flat, self.duration_s) if self.closed else flat.clip(0.0, self.duration_s)
        return self.position(within).reshape(*times.shape, 3)


def sample(
    path: FingertipPath, hz: float, duration_s: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sample a path at even times from its beginning to its end.

    Args:
        path: The path.
        hz: Samples per second, above 0; rounded up so that both ends are included.
        duration_s: Duration, s, above 0; by default one period, or until the path ends.

    Returns:
        Times from 0 on, s, shape (n,), and positions, m, shape (n, 3), with n at least 2.

    Raises:
        PathError: If `hz` or `duration_s` is not a finite number above 0, or the duration of an
            endless path is missing.
    """
    hz = positive("hz", hz)
    length = path.duration_s if duration_s is None else positive("duration_s", duration_s)
    if math.isinf(length):
        raise PathError("This path neither ends nor repeats, so it needs duration_s.")
    steps = max(1, math.ceil(length * hz - 1e-9))  # 1.1 s at 50 Hz are 55.00000000000001 steps.
    times = np.linspace(0.0, length, steps + 1)
    return times, path.at(times)


FASTEST_MPS: Final = 2.0
"""Speed limit of paths, m/s: a fingertip 0.1 m from its knuckle at 20 rad/s.

A faster path is a jump, or has wrong units.
"""


def too_fast(distance_m: float, seconds: float) -> str:
    """Return the end of a sentence about a path that jumps between two points; else ""."""
    if not distance_m > FASTEST_MPS * seconds:
        return ""
    return (
        f"the point moves {distance_m:.3g} m in {seconds:.3g} s, and no fingertip is faster than "
        f"{FASTEST_MPS:g} m/s"
    )


@dataclass(frozen=True, slots=True)
class Harmonics:
    """Motion as a Fourier series.

    At the angle a = 2π `hz` t + `phase` the point is at
    `centre` + Σ (cos(k a) `cosines[k - 1]` + sin(k a) `sines[k - 1]`), with k = 1, 2, …

    Attributes:
        hz: Periods per second, above 0.
        phase: Phase at 0 s, rad.
        centre: Mean position, m.
        cosines: Coefficients of the cosines, m.
        sines: Coefficients of the sines, m; as many.
    """

    hz: float
    phase: float
    centre: Vector
    cosines: tuple[Vector, ...]
    sines: tuple[Vector, ...]

    def __call__(self, t: Times, order: int = 0) -> Points:
        """Return the positions, or their derivative of an order, at times, s, shape (n,)."""
        multiples = np.arange(1.0, len(self.cosines) + 1.0)
        rates = math.tau * self.hz * multiples  # rad/s, shape (k,).
        # Each derivative of a sine or cosine is a quarter turn ahead, times the rate.
        angles = rates * t[:, None] + self.phase * multiples + order * math.pi / 2.0
        grown = rates**order
        points = (grown * np.cos(angles)) @ np.array(self.cosines)
        points += (grown * np.sin(angles)) @ np.array(self.sines)
        if order == 0:
            points += self.centre
        return points


_CENTRE: Final = (0.050, 0.0, -0.045)
_RADIAL: Final = (0.0, 1.0, 0.0)

# Of each of three axes at right angles, shape (3,).
_Axes = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def circle(
    radius: float = 0.012,
    centre: Vector = _CENTRE,
    hz: float = 0.5,
    normal: Vector = _RADIAL,
    phase: float = 0.0,
) -> FingertipPath:
    """Return a circle at constant speed.

    It begins on its distal side (on its dorsal side if `normal` points along x) and turns around
    `normal` by the right-hand rule: by default towards the palm first.

    Args:
        radius: m, above 0.
        centre: m, in the frame of the finger.
        hz: Turns per second, above 0.
        normal: Normal of its plane, of any length except 0.
        phase: Phase at 0 s, rad.

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
    """Return a horizontal figure eight: the lemniscate of Gerono.

    It begins at its crossing, towards its distal loop. Seen against `normal`, it runs clockwise
    around the distal loop and counter-clockwise around the other.

    Args:
        size: Its length along x, or as near to x as its plane allows, m, above 0; it is half as
            wide.
        centre: Place of the crossing, m, in the finger's frame.
        hz: Periods per second, above 0; one period covers both loops.
        normal: Normal of its plane, of any length except 0.
        phase: Phase at 0 s, rad.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    size = positive("The size of a figure eight", size)
    along, across, _ = _axes(normal)
    sines = [size / 2.0 * along, size / 4.0 * across]
    return _closed("figure eight", hz, phase, centre, [np.zeros(3)] * 2, sines)


def line(
    start: Vector = (0.060, 0.0, -0.040),
    end: Vector = (0.040, 0.0, -0.050),
    hz: float = 0.5,
) -> FingertipPath:
    """Return a straight line, traversed back and forth in harmonic motion.

    Args:
        start: First end, m, in the frame of the finger.
        end: Other end, m; elsewhere than `start`.
        hz: Periods per second, above 0; one period covers both directions.

    Raises:
        PathError: If an argument is out of its range, or the speed above `FASTEST_MPS`.
    """
    first = np.array(vector("The start of a line", start))
    last = np.array(vector("The end of a line", end))
    if np.array_equal(first, last):
        raise PathError(f"A line must end elsewhere than it starts, got {start!r} twice.")
    middle = first / 2.0 + last / 2.0
    return _closed("line", hz, 0.0, _vector(middle), [first - middle], [np.zeros(3)])


def curve_3d(
    size: float = 0.024,
    depth: float = 0.008,
    centre: Vector = _CENTRE,
    hz: float = 0.5,
    normal: Vector = _RADIAL,
    phase: float = 0.0,
) -> FingertipPath:
    """Return a figure eight bent out of its plane: a three-dimensional Lissajous curve.

    Compared with `figure_eight`, both loops are bent towards `normal`, and the crossing away.

    Args:
        size: Its length along x, or as near to x as its plane allows, m, above 0; it is half as
            wide.
        depth: Its extent along `normal`, m, above 0: half of it to each side.
        centre: The middle, m, in the finger's frame.
        hz: Periods per second, above 0; one period covers both loops.
        normal: Normal of the plane out of which it is bent, of any length except 0.
        phase: Phase at 0 s, rad.

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
    """Return unit vectors along, across and out of a plane: right-handed, the first close to x."""
    out: NDArray[np.float64] = np.array(vector("The normal of a plane", normal))
    if not out.any():
        raise PathError("The normal of a plane must not be (0, 0, 0): it has no direction.")
    out /= np.abs(out).max()  # First, because the square of a small number may be 0.
    out /= np.linalg.norm(out)
    along: NDArray[np.float64] = np.array([1.0, 0.0, 0.0])
    along -= out[0] * out
    if np.linalg.norm(along) < 1e-6:
        along = np.array([0.0, 0.0, 1.0])
        along -= out[2] * out
    along /= np.linalg.norm(along)
    return along, np.cross(out, along), out


def _closed(
    kind: str,
    hz: float,
    phase: float,
    centre: Vector,
    cosines: list[NDArray[np.float64]],
    sines: list[NDArray[np.float64]],
) -> FingertipPath:
    """Return a closed path as `Harmonics`; `kind` names the shape in messages."""
    hz = positive(f"The hz of a {kind}", hz)
    motion = Harmonics(
        hz=hz,
        phase=number(f"The phase of a {kind}", phase),
        centre=vector(f"The centre of a {kind}", centre),
        cosines=tuple(map(_vector, cosines)),
        sines=tuple(map(_vector, sines)),
    )
    path = FingertipPath(motion, duration_s=1.0 / hz, closed=True)
    with np.errstate(over="ignore", invalid="ignore"):
        around = motion(np.linspace(0.0, path.duration_s, 721), 1)
        fastest = np.hypot(np.hypot(around[:, 0], around[:, 1]), around[:, 2]).max()
    if not fastest <= FASTEST_MPS:
        raise PathError(
            f"This {kind} is as fast as {fastest:.3g} m/s, and no fingertip is faster than "
            f"{FASTEST_MPS:g} m/s: make it smaller, or hz lower."
        )
    return path


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
