"""A path: where a point should be at any time, and how fast it goes there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import PathError

__all__ = [
    "CLOSED_M",
    "FASTEST_MPS",
    "FingertipPath",
    "PathMotion",
    "Points",
    "Times",
    "Vector",
    "finite",
    "jumps",
    "positive",
    "sample",
    "too_fast",
    "vector",
]

Vector = tuple[float, float, float]
"""x, y and z."""

_DIMENSIONS: Final = (3,)


def finite(what: str, value: Any) -> float:
    """A number that is one.

    Args:
        what: What to call it.
        value: As it was given.

    Raises:
        PathError: If it is no number, or not finite.
    """
    if not _is_number(value) or not math.isfinite(value):
        raise PathError(f"{what} must be a finite number, got {value!r}.")
    return float(value)


def positive(what: str, value: Any) -> float:
    """A number above 0.

    Args:
        what: What to call it.
        value: As it was given.

    Raises:
        PathError: If it is no number, not finite or not above 0.
    """
    if not _is_number(value) or not (math.isfinite(value) and value > 0.0):
        raise PathError(f"{what} must be a finite number above 0, got {value!r}.")
    return float(value)


def vector(what: str, value: Any) -> Vector:
    """Three numbers.

    Args:
        what: What to call them.
        value: As they were given: a tuple, a list or an array of shape (3,).

    Raises:
        PathError: If they are not three, no numbers or not finite.
    """
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != _DIMENSIONS or not np.isfinite(numbers).all():
        raise PathError(f"{what} must be three finite numbers (x, y, z), got {value!r}.")
    x, y, z = numbers.tolist()
    return x, y, z


def _is_number(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real)


Times = NDArray[np.float64]
"""Seconds, shape (n,)."""

Points = NDArray[np.float64]
"""Positions in m, or their derivatives by time, shape (n, 3)."""

CLOSED_M: Final = 1e-4
"""How far from its beginning a path may end that counts as closed, m."""


class PathMotion(Protocol):
    """How a point moves from 0 s until its path ends, or begins again."""

    def derivative(self, t: Times, order: int) -> Points:
        """Position, velocity or acceleration.

        Args:
            t: Times from 0 to the end, both included, s, shape (n,).
            order: 0 for positions in m, 1 for m/s, 2 for m/s².

        Returns:
            A new array, shape (n, 3).
        """
        ...


@dataclass(frozen=True, slots=True)
class FingertipPath:
    """A path that a fingertip follows; the functions of this package make them.

    A closed path repeats for ever, to both sides of 0 s. Another one begins at 0 s and ends at
    `duration_s`: before and after the point stays where it begins and ends.

    Attributes:
        motion: How the point moves meanwhile.
        duration_s: How long once round takes, or the path until it ends, s, above 0; infinite for
            a function that goes on for ever without repeating itself.
        closed: Whether it repeats.
    """

    motion: PathMotion
    duration_s: float
    closed: bool

    @property
    def period_s(self) -> float | None:
        """After how long it repeats, s; None for a path that does not."""
        return self.duration_s if self.closed else None

    def at(self, t: ArrayLike) -> NDArray[np.float64]:
        """Where the point is.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Positions in the frame of the finger, m: the shape of `t` and three more, (..., 3).

        Raises:
            PathError: If a time is not finite, or a function has no position to it.
        """
        return self._derivative(t, 0)

    def velocity(self, t: ArrayLike) -> NDArray[np.float64]:
        """How fast the point moves, and whither; 0 before a path begins and after it ended.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Velocities, m/s, shape (..., 3).

        Raises:
            PathError: As `at`.
        """
        return self._derivative(t, 1)

    def acceleration(self, t: ArrayLike) -> NDArray[np.float64]:
        """How the velocity changes; 0 before a path begins and after it ended.

        Args:
            t: Times, s, finite, of any shape and sign.

        Returns:
            Accelerations, m/s², shape (..., 3).

        Raises:
            PathError: As `at`.
        """
        return self._derivative(t, 2)

    def _derivative(self, t: ArrayLike, order: int) -> NDArray[np.float64]:
        times = np.asarray(t, dtype=np.float64)
        if not np.isfinite(times).all():
            raise PathError("A path is asked for finite times in s, got NaN or infinity.")
        flat = times.ravel()
        within = np.mod(flat, self.duration_s) if self.closed else flat.clip(0.0, self.duration_s)
        points = self.motion.derivative(within, order)
        if order and not self.closed:
            points[within != flat] = 0.0
        return points.reshape(*times.shape, 3)


def sample(
    path: FingertipPath, hz: float, duration_s: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and points of a path, evenly and from end to end.

    Args:
        path: What is sampled.
        hz: Samples in a second, above 0. Where they do not fit into the time they come a little
            closer together, so that beginning and end are both among them.
        duration_s: How long, s, above 0; once round, or until the path ends, if left out.

    Returns:
        Times from 0 on, s, shape (n,), and positions, m, shape (n, 3), with n at least 2.

    Raises:
        PathError: If `hz` or `duration_s` is no finite number above 0, or is left out for a path
            that goes on for ever.
    """
    hz = positive("hz", hz)
    length = path.duration_s if duration_s is None else positive("duration_s", duration_s)
    if math.isinf(length):
        raise PathError("This path neither ends nor repeats: say for how long, with duration_s.")
    steps = max(1, math.ceil(length * hz - 1e-9))  # 1.1 s at 50 Hz are 55.00000000000001 steps.
    times = np.linspace(0.0, length, steps + 1)
    return times, path.at(times)


FASTEST_MPS: Final = 2.0
"""The fastest that a path may be, m/s: a fingertip 0.1 m from its knuckle turns at 20 rad/s."""


def jumps(distance_m: float, seconds: float) -> bool:
    """Whether that distance, m, at least 0, in that time, s, at least 0, is a jump."""
    return distance_m > FASTEST_MPS * seconds


def too_fast(distance_m: float, seconds: float) -> str:
    """What to say of a jump of that distance, m, in that time, s: the end of a sentence."""
    return (
        f"the point moves {distance_m:.3g} m in {seconds:.3g} s, and no fingertip is faster than "
        f"{FASTEST_MPS:g} m/s"
    )
