"""Which observations a client was sent, and when, so that the age of a command is known."""

from __future__ import annotations

from collections import deque
from typing import Final

__all__ = ["Sent"]

_NS_PER_MS: Final = 1_000_000
_WINDOW: Final = 64  # At 50 Hz more than a second: older ones are too old in any case.


class Sent:
    """The observations that one client was sent last.

    Args:
        max_age_ms: How old an observation may be that a command answers.
        window: How many are remembered.
    """

    def __init__(self, max_age_ms: int, window: int = _WINDOW) -> None:
        self._max_age_ms = max_age_ms
        self._sent: deque[tuple[int, int]] = deque(maxlen=window)

    def add(self, seq: int, now_ns: int) -> None:
        """Remember that an observation leaves now; its `seq` is larger than those before."""
        self._sent.append((seq, now_ns))

    def refusal(self, answers: int, now_ns: int) -> str:
        """Why what arrives now must not act; empty when it may.

        Args:
            answers: `seq` of the observation that it answers.
            now_ns: The robot's time.
        """
        for seq, sent_ns in reversed(self._sent):
            if seq == answers:
                age_ms = (now_ns - sent_ns) / _NS_PER_MS
                if age_ms > self._max_age_ms:
                    return (
                        f"It answers observation {answers}, which was sent {age_ms:.0f} ms ago; "
                        f"at most {self._max_age_ms} ms are allowed."
                    )
                return ""
        return f"It answers observation {answers}, which was not sent to this client of late."
