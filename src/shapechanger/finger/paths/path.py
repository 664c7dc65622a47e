"""Path of a point over time, and checks of the numbers that define it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import PathError

Vector = tuple[float, float, float]
"""x, y and z."""


def finite(what: str, value: Any) -> float:
    """Return a finite number.

    Args:
        what: Its name, for the message.
        value: The value.

    Raises:
        PathError: If it is not a finite number.
    """
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise PathError(f"{what} must be a finite number, got {value!r}.")
    return float(value)


def positive(what: str, value: Any) -> float:
    """Return a finite number above 0.

    Args:
        what: Its name, for the message.
        value: The value.

    Raises:
        PathError: If it is not a finite number above 0.
    """
    try:
        number = finite(what, value)
    except PathError:
        number = 0.0
    if not number > 0.0:
        raise PathError(f"{what} must be a finite number above 0, got {value!r}.")
    return number


def vector(what: str, value: Any) -> Vector:
    """Return three finite numbers.

    Args:
        what: Their name, for the message.
        value: A tuple, a list or an array of shape (3,).

    Raises:
        PathError: If they are not three finite numbers.
    """
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise PathError(f"{what} must be three finite numbers (x, y, z), got {value!r}.")
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
    """Return the end of a sentence about a path that jumps; empty if it does not.

    Args:
        distance_m: Distance between two points, m.
        seconds: Time between them, s.
    """
    if not distance_m > FASTEST_MPS * seconds:
        return ""
    return (
        f"the point moves {distance_m:.3g} m in {seconds:.3g} s, and no fingertip is faster than "
        f"{FASTEST_MPS:g} m/s"
    )
