"""Notices a tendon that carries nothing: it has snapped, or come off its spool."""

from __future__ import annotations

__all__ = ["Slack"]


class Slack:
    """One tendon.

    Two signs tell. It is wound in further than the finger could let it: certain, at any tension,
    but it needs a zero. Or it winds in nearly as fast as the servo turns without load, for a while:
    earlier, but only where the current overcomes the gears by far. A tendon that snaps while its
    servo stands still at the pretension is noticed when it is next pulled.

    Args:
        shortest_m: Length that the finger cannot shorten it to, m.
        most_m_per_s: Speed from which on it carries nothing, m/s.
        slack_ms: For how long.
    """

    def __init__(self, shortest_m: float, most_m_per_s: float, slack_ms: int) -> None:
        self._shortest_m = shortest_m
        self._most_m_per_s = most_m_per_s
        self._slack_ns = slack_ms * 1_000_000
        self._since_ns: int | None = None

    def see(self, length: float | None, lengthening: float, now_ns: int) -> str:
        """Take in how long the tendon is, and how fast it gets longer.

        Args:
            length: Beyond its zero, m; None without one.
            lengthening: m/s; below 0 while it is wound in.
            now_ns: The time.

        Returns:
            Why it must be slack, in words; empty where it need not be.
        """
        if length is not None and length < self._shortest_m:
            return f"it is wound in by {-1e3 * length:.0f} mm, further than the finger lets it"
        if -lengthening < self._most_m_per_s:
            self._since_ns = None
            return ""
        if self._since_ns is None:
            self._since_ns = now_ns
        if now_ns - self._since_ns >= self._slack_ns:
            return f"it winds in at {-1e3 * lengthening:.0f} mm/s, as without any load"
        return ""
