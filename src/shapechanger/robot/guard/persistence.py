"""Says when something has been so for long enough to be believed."""

from __future__ import annotations

__all__ = ["Persistence"]


class Persistence:
    """A condition that counts once it has held without a break.

    Args:
        for_s: How long it must hold, s.
    """

    def __init__(self, for_s: float) -> None:
        self._for_ns = round(for_s * 1e9)
        self._since_ns: int | None = None

    def holds(self, condition: bool, now_ns: int) -> bool:
        """Whether the condition, which is so now, has been so for long enough."""
        if not condition:
            self._since_ns = None
            return False
        if self._since_ns is None:
            self._since_ns = now_ns
        return now_ns - self._since_ns >= self._for_ns
