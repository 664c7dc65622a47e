"""How a stop takes the tensions down."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["Ramp"]


class Ramp:
    """From some tensions to others, in a straight line over time.

    Args:
        start: Tension of each tendon at the beginning, N, by name.
        end: At the end; the same names.
        since_ns: When it begins.
        ramp_ms: How long it takes.
    """

    def __init__(
        self, start: Mapping[str, float], end: Mapping[str, float], since_ns: int, ramp_ms: int
    ) -> None:
        # Nobody pulls harder because of a stop.
        self._start = {name: max(value, end[name]) for name, value in start.items()}
        self._end = dict(end)
        self._since_ns = since_ns
        self._ramp_ns = ramp_ms * 1_000_000

    def tensions(self, now_ns: int) -> dict[str, float]:
        """What each tendon pulls now, N."""
        left = self._left(now_ns)
        return {
            name: self._end[name] + left * (value - self._end[name])
            for name, value in self._start.items()
        }

    def is_over(self, now_ns: int) -> bool:
        """Whether all of them are at the end."""
        return self._left(now_ns) == 0.0

    def _left(self, now_ns: int) -> float:
        """How much of the way is left, 1 to 0."""
        gone_ns = now_ns - self._since_ns
        if gone_ns >= self._ramp_ns:
            return 0.0
        return min(1.0, 1.0 - gone_ns / self._ramp_ns)
