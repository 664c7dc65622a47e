"""How much a client may ask: messages a second, and tries with a wrong key."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from time import monotonic
from typing import Final

__all__ = ["MESSAGES_PER_S", "MessageRate", "WrongKeys"]

MESSAGES_PER_S: Final = 500.0
"""Messages a second that a connection may send; a driver sends 50."""

_TRIES: Final = 5
_FORGOTTEN_AFTER_S: Final = 60.0
_MOST_ADDRESSES: Final = 1024


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


class WrongKeys:
    """Remembers who tried a wrong key: five tries a minute for each address.

    Args:
        clock: Seconds of a monotonic clock.
    """

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._tries: OrderedDict[str, list[float]] = OrderedDict()

    def wait_s(self, address: str) -> float:
        """Seconds until an address may try again; 0 for now."""
        tries = self._recent(address)
        if len(tries) < _TRIES:
            return 0.0
        return max(0.0, tries[-_TRIES] + _FORGOTTEN_AFTER_S - self._clock())

    def add(self, address: str) -> None:
        """Count a wrong key."""
        self._tries[address] = [*self._recent(address), self._clock()][-_TRIES:]
        self._tries.move_to_end(address)
        if len(self._tries) > _MOST_ADDRESSES:
            self._tries.popitem(last=False)

    def _recent(self, address: str) -> list[float]:
        since = self._clock() - _FORGOTTEN_AFTER_S
        return [at for at in self._tries.get(address, []) if at > since]
