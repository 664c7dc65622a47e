"""Numbers as a user gave them, checked."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any, Final

import numpy as np

from shapechanger.errors import PathError

__all__ = ["Vector", "finite", "positive", "vector"]

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
