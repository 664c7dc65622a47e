"""A client of the robot, its limits, and the lease that one client holds."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from time import monotonic
from typing import Final

from shapechanger.robot.link.messages import Event, Lease, RecorderState, RobotMessage, Role

MESSAGES_PER_S: Final = 500.0
"""Messages per second that a connection may send; a driver sends 50."""

_MAX_EVENTS: Final = 32
_MAX_MESSAGES: Final = 256
_NS_PER_MS: Final = 1_000_000
_WINDOW: Final = 64  # More than a second at 50 Hz; older observations are stale in any case.


class Client:
    """A client as the robot reaches it: its identity, and the messages that wait for it.

    Of messages other than observations it keeps the newest lease, the newest recorder state and the
    newest 32 events. Others are accepted while fewer than 256 are queued.

    Attributes:
        session: Number of the connection.
        name: Display name; empty before its hello.
        role: "person" or "program".
        posted: Set when a message waits.
        updated: Set when an observation may be due.
        is_full: True once a message did not fit, because the client does not read.
        expelled: Reason why the connection must end; "" if it may go on.
    """

    def __init__(self, session: int, name: str = "", role: Role = "program") -> None:
        self.session = session
        self.name = name
        self.role: Role = role
        self.posted = asyncio.Event()
        self.updated = asyncio.Event()
        self.is_full = False
        self.expelled = ""
        self._messages: deque[RobotMessage] = deque()

    @property
    def is_person(self) -> bool:
        """True for a person, False for a program."""
        return self.role == "person"

    def post(self, message: RobotMessage) -> None:
        """Queue a message; one that does not fit is lost, and sets `is_full`."""
        self.posted.set()
        if isinstance(message, Lease | RecorderState):
            self._trim(type(message), keep=0)
        elif isinstance(message, Event):
            self._trim(Event, keep=_MAX_EVENTS - 1)
        elif len(self._messages) >= _MAX_MESSAGES:
            self.is_full = True
            return
        self._messages.append(message)

    def take(self) -> RobotMessage | None:
        """Remove and return the oldest message, or None if the queue is empty."""
        return self._messages.popleft() if self._messages else None

    def awaits(self, *kinds: type[RobotMessage]) -> bool:
        """Return True if a message of one of these types, or of any without types, is queued."""
        return any(isinstance(message, kinds or object) for message in self._messages)

    def expel(self, reason: str) -> None:
        """End the connection, for a reason that is a sentence."""
        self.expelled = reason
        self.posted.set()

    def _trim(self, kind: type[RobotMessage], keep: int) -> None:
        """Remove the oldest messages of a type until `keep` are left."""
        queued = [message for message in self._messages if isinstance(message, kind)]
        for message in queued[: max(0, len(queued) - keep)]:
            self._messages.remove(message)


class ControlLease:
    """Control of the robot, held by one client at a time.

    Attributes:
        number: Number of the current lease, or of the last one. Each lease has a larger number
            than the one before, so that commands of an earlier lease can be recognised.
        holder: The client that holds the lease, or None.
    """

    def __init__(self) -> None:
        self.number = 0
        self.holder: Client | None = None

    @property
    def holder_name(self) -> str:
        """Name of the client that holds the lease; "" for none."""
        return "" if self.holder is None else self.holder.name

    def refusal(self, client: Client) -> str:
        """Return the reason why `client` cannot take the lease now, or "" if it can."""
        held = self.holder
        if held is None or held is client or (client.is_person and not held.is_person):
            return ""
        return f"{held.name} has control; a {client.role} cannot take it from a {held.role}."

    def take(self, client: Client) -> Client | None:
        """Give the lease to a client that `refusal` accepts.

        Returns:
            The client that lost the lease, or None.
        """
        held = self.holder
        if held is client:
            return None
        self.holder = client
        self.number += 1
        return held


class MessageRate:
    """Token bucket that holds one second's worth of messages."""

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


class SentObservations:
    """The last observations sent to one client, and when."""

    def __init__(self, max_age_ms: int, window: int = _WINDOW) -> None:
        self._max_age_ms = max_age_ms
        self._sent: deque[tuple[int, int]] = deque(maxlen=window)

    def add(self, seq: int, now_ns: int) -> None:
        """Remember that an observation is sent now."""
        self._sent.append((seq, now_ns))

    def refusal(self, answers: int, now_ns: int) -> str:
        """Return the reason why a message must not act, or "" if it may."""
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
