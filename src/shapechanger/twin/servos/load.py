"""What the tendons pull at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

__all__ = ["EndStops", "Load"]


class Load(Protocol):
    """What is at the far end of all tendons of a line, such as a finger."""

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Let some time go by under these tensions.

        Args:
            tensions_n: N for each tendon, in the order of the servos; never below 0.
            dt_s: How long they act.

        Returns:
            How far each tendon's end has moved towards its spool since the beginning, m; below 0
            for away from it.
        """
        ...


class EndStops:
    """For each tendon a spring with a damper between two stops; it has no mass.

    Args:
        count: How many tendons.
        stiffness: N/m.
        damping: N·s/m.
        nearest_m: How far an end can be pulled, m.
        farthest_m: How far it can go the other way, m; 0 or below.
    """

    def __init__(
        self,
        count: int,
        stiffness: float = 300.0,
        damping: float = 60.0,
        nearest_m: float = 0.02,
        farthest_m: float = 0.0,
    ) -> None:
        self._stiffness = stiffness
        self._lag_s = damping / stiffness
        self._range = (farthest_m, nearest_m)
        self.travels = [0.0] * count
        """Where the ends are, m."""

    def pull(self, tensions_n: Sequence[float], dt_s: float) -> Sequence[float]:
        """Let some time go by; see `Load`."""
        keep = math.exp(-dt_s / self._lag_s)
        low, high = self._range
        for i, tension in enumerate(tensions_n):
            rest = tension / self._stiffness
            self.travels[i] = min(max(rest + keep * (self.travels[i] - rest), low), high)
        return self.travels
