"""How often the processes of a robot may be started afresh."""

from __future__ import annotations

from collections import deque
from typing import Final

__all__ = ["Restarts"]

_PAUSE_S: Final = 0.2


class Restarts:
    """Counts the restarts of the recent past.

    Args:
        most: How many there may be in that time.
        within_s: The time, s.
    """

    def __init__(self, most: int = 5, within_s: float = 60.0) -> None:
        self._most = most
        self._within_ns = round(within_s * 1e9)
        self._times_ns: deque[int] = deque()

    @property
    def pause_s(self) -> float:
        """How long to wait before the restart that counted last, s: twice as long each time."""
        return _PAUSE_S * (2 ** (len(self._times_ns) - 1) - 1)

    def may_restart(self, now_ns: int) -> bool:
        """Whether there may be one more now, which then counts."""
        while self._times_ns and now_ns - self._times_ns[0] >= self._within_ns:
            self._times_ns.popleft()
        if len(self._times_ns) >= self._most:
            return False
        self._times_ns.append(now_ns)
        return True
