"""How much a client may say: so many messages a second."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Final

__all__ = ["MESSAGES_PER_S", "MessageRate"]

MESSAGES_PER_S: Final = 500.0
"""Messages a second that a connection may send; a driver sends 50."""


class MessageRate:
    """A bucket of tokens: one second's worth may come at once.

    Args:
        per_s: Messages a second.
        clock: Seconds of a monotonic clock.
    """

    def __init__(
        self, per_s: float = MESSAGES_PER_S, clock: Callable[[], float] = monotonic
    ) -> None:
        self._per_s = per_s
        self._clock = clock
        self._tokens = per_s
        self._at = clock()

    def spend(self) -> bool:
        """Count one message; whether it is still within the rate."""
        now = self._clock()
        self._tokens = min(self._per_s, self._tokens + (now - self._at) * self._per_s)
        self._at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

    def give_back(self) -> None:
        """Do not count one message, because the robot itself kept the pace."""
        self._tokens = min(self._per_s, self._tokens + 1.0)
