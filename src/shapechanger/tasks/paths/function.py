"""A path that is a function of the user's."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from shapechanger.errors import PathError
from shapechanger.tasks.paths.asked import positive
from shapechanger.tasks.paths.path import CLOSED_M, Path, Points, Times
from shapechanger.tasks.paths.speed import jumps, too_fast

__all__ = ["Function", "from_callable"]

_STEP_S: Final = 1e-3  # Of differences: the error at 5 Hz is a millionth of the velocity.
_NODES: Final = np.arange(-2.0, 3.0)
# Values at the nodes become coefficients of the polynomial through them, shape (5, 5).
_COEFFICIENTS: Final = np.linalg.inv(np.vander(_NODES, increasing=True))

# How a function is checked: over all its time, or as much of it where it never ends; ...
_CHECKED_S: Final = 10.0
_CHECKED_HZ: Final = 500.0
_FEWEST_CHECKED: Final = 200
_MOST_CHECKED: Final = 10_000
# ... and where it is least smooth, down to such a short time.
_SUSPECTS: Final = 16
_SHORTEST_S: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Function:
    """Motion as a function says; its derivatives come from differences.

    Attributes:
        function: Takes a time in s, gives x, y and z in m.
        duration_s: Up to where it may be asked, s, above 0; infinite for always.
    """

    function: Callable[[float], ArrayLike]
    duration_s: float

    def derivative(self, t: Times, order: int) -> Points:
        """Position, velocity or acceleration, as `Motion` says.

        Raises:
            PathError: If the function gives something else than three finite numbers.
        """
        if order == 0:
            return np.array([self.point(float(now)) for now in t]).reshape(-1, 3)
        # A polynomial through five points around the time: at both ends the time is not in their
        # middle, as the function may know nothing beyond.
        step = min(_STEP_S, self.duration_s / 4.0)
        middle = t.clip(2.0 * step, self.duration_s - 2.0 * step)
        nodes = (middle + step * _NODES[:, None]).clip(0.0, self.duration_s)
        values = self.derivative(nodes.ravel(), 0).reshape(5, -1, 3)
        u = (t - middle) / step
        ones, zeros = np.ones_like(u), np.zeros_like(u)
        powers = {
            1: np.stack([zeros, ones, 2.0 * u, 3.0 * u**2, 4.0 * u**3]),
            2: np.stack([zeros, zeros, 2.0 * ones, 6.0 * u, 12.0 * u**2]),
        }
        return np.einsum("kn,kj,jnd->nd", powers[order] / step**order, _COEFFICIENTS, values)

    def point(self, t: float) -> Points:
        """Where the point is at one time, m, shape (3,).

        Raises:
            PathError: If the function gives something else than three finite numbers.
        """
        given = self.function(t)
        try:
            point = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            point = np.empty(0)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise PathError(
                "The function of a path must give three finite numbers (x, y, z) in m, and at "
                f"{t:.6g} s it gave {given!r}."
            )
        return point


def from_callable(
    function: Callable[[float], ArrayLike],
    duration_s: float | None = None,
    period_s: float | None = None,
) -> Path:
    """A path that a function describes.

    It is tried out here, 500 times in a second and 10 000 times at most, and again where it is
    least smooth; so a jump of a hundredth of a millimetre is found, but one that hides in a
    rough function may not be. Velocity and acceleration come from differences over 4 ms, for which
    the function should be smooth.

    Args:
        function: Takes a time in s, from 0 to the end, and gives x, y and z in the frame of the
            finger, m. The same time must always give the same point.
        duration_s: When the path ends, s, above 0: after that the point stays.
        period_s: After how long it repeats, s, above 0: the point must be back, within 0.1 mm.
            Only one of the two; with neither, the path goes on for ever, and its first 10 s are
            tried out.

    Raises:
        PathError: If it gives something else than three finite numbers, jumps, is faster than
            `FASTEST_MPS`, or is not back after `period_s`; if a time is no finite number above 0,
            or both are given.
    """
    if duration_s is not None and period_s is not None:
        raise PathError(
            "A path ends after duration_s or repeats after period_s, got both: leave one out."
        )
    length = math.inf
    if duration_s is not None:
        length = positive("duration_s", duration_s)
    if period_s is not None:
        length = positive("period_s", period_s)
    motion = Function(function, length)
    _require_continuous(motion)
    if period_s is not None:
        apart = math.dist(motion.point(0.0), motion.point(length))
        if apart > CLOSED_M:
            raise PathError(
                f"After its period of {length:.6g} s the path is {apart * 1e3:.3g} mm from where "
                f"it began, and {CLOSED_M * 1e3:g} mm are allowed: give another period_s, or its "
                "end as duration_s."
            )
    return Path(motion, length, closed=period_s is not None)


def _require_continuous(motion: Function) -> None:
    """Try a function out.

    Raises:
        PathError: If it jumps.
    """
    length = _CHECKED_S if math.isinf(motion.duration_s) else motion.duration_s
    n = round(min(max(length * _CHECKED_HZ, _FEWEST_CHECKED), _MOST_CHECKED))
    times = np.linspace(0.0, length, n + 1)
    points = motion.derivative(times, 0)
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(points, axis=0)
        around = np.vstack([steps[:1], steps, steps[-1:]])
        roughness = np.linalg.norm(steps - (around[:-2] + around[2:]) / 2.0, axis=1)
        fastest = int(np.argmax(np.linalg.norm(steps, axis=1)))
    for i in (fastest, *np.argsort(roughness)[-_SUSPECTS:].tolist()):
        _require_no_jump(motion, float(times[i]), float(times[i + 1]))


def _require_no_jump(motion: Function, start: float, end: float) -> None:
    """Look closer and closer at where it goes furthest: only a jump stays as far.

    Raises:
        PathError: If it does.
    """
    first, last = motion.point(start), motion.point(end)
    while True:
        distance = math.dist(first, last)
        if jumps(distance, end - start):
            raise PathError(f"At {start:.6g} s the path jumps: {too_fast(distance, end - start)}.")
        middle = start / 2.0 + end / 2.0
        if end - start < _SHORTEST_S or not start < middle < end:
            return
        between = motion.point(middle)
        if math.dist(first, between) > math.dist(between, last):
            end, last = middle, between
        else:
            start, first = middle, between
