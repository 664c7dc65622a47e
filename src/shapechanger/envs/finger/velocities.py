"""Velocities of joints whose angles are measured, as a computer beside the finger makes them."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["JointVelocities"]

# Time constant, s, with which noisy angles become velocities: two periods of control.
_LAG_S: Final = 0.040


class JointVelocities:
    """Differences of what was measured, smoothed.

    Args:
        period_s: Time from one measurement to the next, s.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._share = 1.0 - math.exp(-period_s / _LAG_S)
        self._angles: NDArray[np.float64] | None = None
        self._velocities = np.zeros(0)

    def forget(self) -> None:
        """Begin anew: what is measured next is at rest."""
        self._angles = None

    def of(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """The velocities, rad/s, after these angles, rad, of the same shape."""
        if self._angles is None:
            self._velocities = np.zeros_like(angles)
        else:
            speed = (angles - self._angles) / self._period_s
            self._velocities = self._velocities + self._share * (speed - self._velocities)
        self._angles = angles.copy()
        return self._velocities
