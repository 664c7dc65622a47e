"""Noise on what a demonstrator does, so that a learner sees how mistakes are put right.

The vehicle does what `applied` returns, and the record keeps what the demonstrator meant: M. Laskey
et al., "DART: Noise Injection for Robust Imitation Learning", CoRL 2017. The two kinds are those
that drivers make: a hand that wanders (G. E. Uhlenbeck, L. S. Ornstein, "On the theory of the
Brownian motion", Physical Review 36, 1930), and a jerk now and then.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.expert.traits import traits_of

__all__ = ["Disturbance"]

WANDER_S: Final = 0.6
"""Time over which wandering forgets itself."""

JERKS_PER_S: Final = 0.25
JERK_S: Final = (0.15, 0.5)
"""Shortest and longest."""


class Disturbance:
    """What happens to actions on their way to the vehicle.

    Args:
        kind: Whether it wanders, jerks, or both.
        seed: What it follows from.
        size: Standard deviation of the wandering of steering and throttle; jerks steer by up to
            three times the first.
        period_s: Time from one action to the next, s.
    """

    def __init__(
        self,
        kind: Literal["wander", "jerks", "both"] = "both",
        seed: int = 0,
        *,
        size: tuple[float, float] = (0.25, 0.1),
        period_s: float = 0.05,
    ) -> None:
        self._wanders = kind in ("wander", "both")
        self._jerks = kind in ("jerks", "both")
        self._size = np.array(size)
        self._period_s = period_s
        self._rng = np.random.default_rng(seed)
        self._wander = np.zeros(2)
        self._jerk, self._jerk_s = 0.0, 0.0

    @classmethod
    def of(
        cls,
        vehicle: str,
        kind: Literal["wander", "jerks", "both"] = "both",
        seed: int = 0,
        *,
        period_s: float = 0.05,
    ) -> Disturbance:
        """As much of it as a vehicle can put right.

        Args:
            vehicle: Its name.
            kind: See `Disturbance`.
            seed: See `Disturbance`.
            period_s: See `Disturbance`.

        Raises:
            UnknownName: No expert knows the vehicle.
        """
        return cls(kind, seed, size=(traits_of(vehicle).sway, 0.1), period_s=period_s)

    def applied(self, action: NDArray[np.float32]) -> NDArray[np.float32]:
        """What the vehicle does instead of an action, (2,) from -1 to 1."""
        noise = np.zeros(2)
        if self._wanders:
            # The exact step of the process, whatever the period is.
            keep = math.exp(-self._period_s / WANDER_S)
            fresh = self._size * math.sqrt(1 - keep**2)
            self._wander = keep * self._wander + fresh * self._rng.standard_normal(2)
            noise += self._wander
        if self._jerks:
            noise[0] += self._jerked()
        return np.clip(action + noise, -1.0, 1.0).astype(np.float32)

    def _jerked(self) -> float:
        """Steering of the jerk that is going on, 0 without one."""
        self._jerk_s -= self._period_s
        if self._jerk_s > 0:
            return self._jerk
        if self._rng.random() < JERKS_PER_S * self._period_s:
            self._jerk = float(3 * self._size[0] * self._rng.uniform(-1, 1))
            self._jerk_s = float(self._rng.uniform(*JERK_S))
            return self._jerk
        return 0.0
