"""Clients of the robot."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Final, NamedTuple

from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.link import messages

NOT_READING: Final = "The client does not read its messages."

_MAX_MESSAGES: Final = 256
# Number of newest messages to keep, keyed by type; messages of other types are all kept.
_KEPT: Final = {messages.Lease: 1, messages.RecorderState: 1, messages.Event: 32}


class Declined(Exception):
    """The robot declines a request; the message is the reason, and the connection continues."""


class Sent(NamedTuple):
    """An observation that was sent to a client, and the newest frame at that time."""

    observation: messages.Observation
    frame: Frame | None


class Client:
    """A client of the robot: its identity and its queue of messages.

    The queue is for messages other than observations. It keeps the newest lease, the newest
    recorder state and the newest 32 events; others are accepted while fewer than 256 are queued.
    """

    def __init__(self, session: int, name: str = "", role: messages.Role = "program") -> None:
        self.session = session  # Number of the connection.
        self.name = name  # Display name; empty before its hello.
        self.role: messages.Role = role
        self.posted = asyncio.Event()  # Set when a message waits.
        self.updated = asyncio.Event()  # Set when an observation may be due.
        self.expelled = ""  # Sentence on why the connection must end; "" if it may continue.
        self._messages: deque[messages.RobotMessage] = deque()

    @property
    def is_person(self) -> bool:
        """True for a person, False for a program."""
        return self.role == "person"

    def post(self, message: messages.RobotMessage) -> None:
        """Queue a message; if the queue is full, the message is lost and the client is expelled."""
        kind = type(message)
        if kind in _KEPT:
            same = [queued for queued in self._messages if type(queued) is kind]
            if len(same) == _KEPT[kind]:
                self._messages.remove(same[0])
        elif len(self._messages) >= _MAX_MESSAGES:
            self.expel(NOT_READING)
            return
        self._messages.append(message)
        self.posted.set()

    def take(self) -> messages.RobotMessage | None:
        """Remove and return the oldest message, or None if the queue is empty."""
        return self._messages.popleft() if self._messages else None

    def awaits(self, *kinds: type[messages.RobotMessage]) -> bool:
        """Return True if a message of one of `kinds` is queued; without `kinds`, of any type."""
        return any(isinstance(message, kinds or object) for message in self._messages)

    def expel(self, reason: str) -> None:
        """End the connection; `reason` must be a sentence."""
        self.expelled = reason
        self.posted.set()
