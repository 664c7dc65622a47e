"""Noise on a demonstrator's actions, so that demonstrations show how to correct errors.

The vehicle executes the result of `applied`, and the demonstrator's own action is recorded (M.
Laskey et al., "DART: Noise Injection for Robust Imitation Learning", CoRL 2017). There are two
kinds: slow wandering (G. E. Uhlenbeck, L. S. Ornstein, "On the theory of the Brownian motion",
Physical Review 36, 1930) and rare jerks of the steering.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.expert.traits import PERIOD_S

WANDER_S: Final = 0.6
"""Correlation time of the wandering, s."""

JERKS_PER_S: Final = 0.25
"""Mean rate of jerks, 1/s."""

JERK_S: Final = (0.15, 0.5)
"""Shortest and longest duration of a jerk, s."""


THROTTLE_SD: Final = 0.1
"""Standard deviation of the wandering of the throttle."""


class Disturbance:
    """Noise on steering and throttle.

    Args:
        seed: Seed of the noise.
        sway: Standard deviation of the wandering of the steering; jerks steer by up to three times
            as much.
    """

    def __init__(self, seed: int, sway: float) -> None:
        self._size = np.array((sway, THROTTLE_SD))
        self._rng = np.random.default_rng(seed)
        self._wander = np.zeros(2)
        self._jerk, self._jerk_s = 0.0, 0.0

    def applied(self, action: NDArray[np.float32]) -> NDArray[np.float32]:
        """Add noise to an action, (2,), and clip it to -1 to 1."""
        # The exact discretization, for any period.
        keep = math.exp(-PERIOD_S / WANDER_S)
        fresh = self._size * math.sqrt(1 - keep**2)
        self._wander = keep * self._wander + fresh * self._rng.standard_normal(2)
        noise = self._wander + np.array((self._jerked(), 0.0))
        return np.clip(action + noise, -1.0, 1.0).astype(np.float32)

    def _jerked(self) -> float:
        """Steering of the current jerk; 0 without one."""
        self._jerk_s -= PERIOD_S
        if self._jerk_s > 0:
            return self._jerk
        if self._rng.random() < JERKS_PER_S * PERIOD_S:
            self._jerk = float(3 * self._size[0] * self._rng.uniform(-1, 1))
            self._jerk_s = float(self._rng.uniform(*JERK_S))
            return self._jerk
        return 0.0
