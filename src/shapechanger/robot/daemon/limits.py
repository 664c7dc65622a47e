"""How much a client may say: so many messages a second."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import monotonic
from typing import Final

from shapechanger.errors import LinkError
from shapechanger.link.messages import Event, Lease, RecorderState, RobotMessage

__all__ = ["MESSAGES_PER_S", "MessageRate", "Outbox", "SentObservations", "printable"]

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


_MAX_EVENTS: Final = 32
_MAX_MESSAGES: Final = 256


class Outbox:
    """Messages that wait to be sent to one client.

    Of leases and of the recorder's states only the newest one waits, and of events the newest 32;
    of answers there may be 256, and then the client does not read.
    """

    def __init__(self) -> None:
        self._messages: deque[RobotMessage] = deque()

    def __len__(self) -> int:
        """How many wait."""
        return len(self._messages)

    def put(self, message: RobotMessage) -> None:
        """Add a message.

        Raises:
            LinkError: If too many wait already.
        """
        if isinstance(message, Lease | RecorderState):
            self._drop(type(message), keep=0)
        elif isinstance(message, Event):
            self._drop(Event, keep=_MAX_EVENTS - 1)
        elif len(self._messages) >= _MAX_MESSAGES:
            raise LinkError("You do not read what you are told.")
        self._messages.append(message)

    def take(self) -> RobotMessage | None:
        """The oldest message; None for none."""
        return self._messages.popleft() if self._messages else None

    def holds(self, *kinds: type[RobotMessage]) -> bool:
        """Whether a message of one of these kinds waits."""
        return any(isinstance(message, kinds) for message in self._messages)

    def _drop(self, kind: type[RobotMessage], keep: int) -> None:
        """Drop the oldest messages of a kind until so many are left."""
        surplus = sum(isinstance(message, kind) for message in self._messages) - keep
        if surplus <= 0:
            return
        kept: deque[RobotMessage] = deque()
        for message in self._messages:
            if surplus > 0 and isinstance(message, kind):
                surplus -= 1
            else:
                kept.append(message)
        self._messages = kept


_NS_PER_MS: Final = 1_000_000
_WINDOW: Final = 64  # At 50 Hz more than a second: older ones are too old in any case.


class SentObservations:
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


def printable(text: str) -> str:
    """Without what moves a terminal's cursor, and in one line."""
    return "".join(c if c.isprintable() else " " for c in text).strip()
