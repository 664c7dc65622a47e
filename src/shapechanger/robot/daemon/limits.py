"""Limits for one client: its message rate, its outbox, and the age of what it answers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import monotonic
from typing import Final

from shapechanger.errors import LinkError
from shapechanger.link.messages import Event, Lease, RecorderState, RobotMessage

__all__ = ["MESSAGES_PER_S", "MessageRate", "Outbox", "SentObservations", "printable"]

MESSAGES_PER_S: Final = 500.0
"""Messages per second that a connection may send; a driver sends 50."""

_MAX_EVENTS: Final = 32
_MAX_MESSAGES: Final = 256
_NS_PER_MS: Final = 1_000_000
_WINDOW: Final = 64  # More than a second at 50 Hz; older observations are stale in any case.


class MessageRate:
    """Token bucket that holds one second's worth of messages.

    Args:
        per_s: Messages per second.
        clock: Monotonic clock, s.
    """

    def __init__(
        self, per_s: float = MESSAGES_PER_S, clock: Callable[[], float] = monotonic
    ) -> None:
        self._per_s = per_s
        self._clock = clock
        self._tokens = per_s
        self._at = clock()

    def spend(self) -> bool:
        """Count one message. Return False if it exceeds the rate."""
        now = self._clock()
        self._tokens = min(self._per_s, self._tokens + (now - self._at) * self._per_s)
        self._at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

    def give_back(self) -> None:
        """Uncount one message, because the robot set the pace."""
        self._tokens = min(self._per_s, self._tokens + 1.0)


class Outbox:
    """Queue of messages for one client, other than observations.

    It keeps the newest lease, the newest recorder state and the newest 32 events. Other messages
    are accepted while fewer than 256 are queued.
    """

    def __init__(self) -> None:
        self._messages: deque[RobotMessage] = deque()

    def __len__(self) -> int:
        """Return the number of queued messages."""
        return len(self._messages)

    def put(self, message: RobotMessage) -> None:
        """Add a message.

        Raises:
            LinkError: If the client does not read and the queue is full.
        """
        if isinstance(message, Lease | RecorderState):
            self._trim(type(message), keep=0)
        elif isinstance(message, Event):
            self._trim(Event, keep=_MAX_EVENTS - 1)
        elif len(self._messages) >= _MAX_MESSAGES:
            raise LinkError("The client does not read its messages.")
        self._messages.append(message)

    def take(self) -> RobotMessage | None:
        """Remove and return the oldest message, or None if the queue is empty."""
        return self._messages.popleft() if self._messages else None

    def holds(self, *kinds: type[RobotMessage]) -> bool:
        """Return True if a message of one of these types is queued."""
        return any(isinstance(message, kinds) for message in self._messages)

    def _trim(self, kind: type[RobotMessage], keep: int) -> None:
        """Remove the oldest messages of a type until `keep` are left."""
        queued = [message for message in self._messages if isinstance(message, kind)]
        for message in queued[: max(0, len(queued) - keep)]:
            self._messages.remove(message)


class SentObservations:
    """The last observations sent to one client, and when.

    Args:
        max_age_ms: Oldest observation that a command may answer, ms since it was sent.
        window: Number of observations to remember.
    """

    def __init__(self, max_age_ms: int, window: int = _WINDOW) -> None:
        self._max_age_ms = max_age_ms
        self._sent: deque[tuple[int, int]] = deque(maxlen=window)

    def add(self, seq: int, now_ns: int) -> None:
        """Remember that observation `seq` is sent now; `seq` increases from call to call."""
        self._sent.append((seq, now_ns))

    def refusal(self, answers: int, now_ns: int) -> str:
        """Return the reason why a message must not act, or "" if it may.

        Args:
            answers: `seq` of the observation that the message answers.
            now_ns: The robot's time, ns.
        """
        sent_ns = dict(self._sent).get(answers)
        if sent_ns is None:
            return f"Observation {answers} was not sent to this client recently."
        age_ms = (now_ns - sent_ns) / _NS_PER_MS
        if age_ms > self._max_age_ms:
            return (
                f"Observation {answers} was sent {age_ms:.0f} ms ago; "
                f"at most {self._max_age_ms} ms are allowed."
            )
        return ""


def printable(text: str) -> str:
    """Return `text` as one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text).strip()
