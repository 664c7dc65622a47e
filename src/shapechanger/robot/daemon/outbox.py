"""What a client is told besides observations, bounded, so that a slow reader costs nothing."""

from __future__ import annotations

from collections import deque
from typing import Final

from shapechanger.errors import LinkError
from shapechanger.link.messages import Event, Lease, RecorderState, RobotMessage

__all__ = ["Outbox"]

_MOST_EVENTS: Final = 32
_MOST_MESSAGES: Final = 256


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
            self._drop(Event, keep=_MOST_EVENTS - 1)
        elif len(self._messages) >= _MOST_MESSAGES:
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
