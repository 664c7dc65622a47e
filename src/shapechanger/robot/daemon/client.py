"""A client of the robot: its identity, and the messages that wait for it."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Final, NamedTuple

from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.link.messages import (
    Event,
    Lease,
    Observation,
    RecorderState,
    RobotMessage,
    Role,
)

_MAX_EVENTS: Final = 32
_MAX_MESSAGES: Final = 256


class Sent(NamedTuple):
    """An observation that a client was sent, and the newest frame at that time."""

    observation: Observation
    frame: Frame | None


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
