"""Noise on a demonstrator's actions, so that demonstrations show how to correct errors.

The vehicle executes the result of `applied`, and the demonstrator's own action is recorded (M.
Laskey et al., "DART: Noise Injection for Robust Imitation Learning", CoRL 2017). There are two
kinds: slow wandering (G. E. Uhlenbeck, L. S. Ornstein, "On the theory of the Brownian motion",
Physical Review 36, 1930) and rare jerks of the steering.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.expert.traits import traits_of

WANDER_S: Final = 0.6
"""Correlation time of the wandering, s."""

JERKS_PER_S: Final = 0.25
"""Mean rate of jerks, 1/s."""

JERK_S: Final = (0.15, 0.5)
"""Shortest and longest duration of a jerk, s."""


class Disturbance:
    """Noise on steering and throttle.

    Args:
        kind: Kind of noise.
        seed: Seed of the noise.
        size: Standard deviation of the wandering of steering and throttle; jerks steer by up to
            three times the first.
        period_s: Control period, s.
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
        """Noise of a size that the expert can correct with a vehicle.

        Args:
            vehicle: Name of the vehicle.
            kind: See `Disturbance`.
            seed: See `Disturbance`.
            period_s: See `Disturbance`.

        Raises:
            UnknownName: If the vehicle is unknown.
        """
        return cls(kind, seed, size=(traits_of(vehicle).sway, 0.1), period_s=period_s)

    def applied(self, action: NDArray[np.float32]) -> NDArray[np.float32]:
        """Add noise to an action, (2,), and clip it to -1 to 1."""
        noise = np.zeros(2)
        if self._wanders:
            # The exact discretization, for any period.
            keep = math.exp(-self._period_s / WANDER_S)
            fresh = self._size * math.sqrt(1 - keep**2)
            self._wander = keep * self._wander + fresh * self._rng.standard_normal(2)
            noise += self._wander
        if self._jerks:
            noise[0] += self._jerked()
        return np.clip(action + noise, -1.0, 1.0).astype(np.float32)

    def _jerked(self) -> float:
        """Steering of the current jerk; 0 without one."""
        self._jerk_s -= self._period_s
        if self._jerk_s > 0:
            return self._jerk
        if self._rng.random() < JERKS_PER_S * self._period_s:
            self._jerk = float(3 * self._size[0] * self._rng.uniform(-1, 1))
            self._jerk_s = float(self._rng.uniform(*JERK_S))
            return self._jerk
        return 0.0
