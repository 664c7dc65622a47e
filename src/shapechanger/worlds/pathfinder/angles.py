"""Differences of directions."""

from __future__ import annotations

import math

__all__ = ["wrapped"]


def wrapped(angle: float) -> float:
    """The same direction as an angle from -pi to pi, rad."""
    return math.remainder(angle, 2 * math.pi)
