"""The newest observation, handed from the thread that receives to the one that decides."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from shapechanger.errors import LinkError, StaleObservation
from shapechanger.link.messages import Observation

__all__ = ["Inbox", "Received"]


@dataclass(frozen=True, slots=True)
class Received:
    """An observation and when it came.

    Attributes:
        message: What the robot said.
        received_at: When it arrived, s of this machine's monotonic clock.
        jpeg: Picture number `message.frame_seq`, whichever message brought it; None without one.
    """

    message: Observation
    received_at: float
    jpeg: bytes | None


class Inbox:
    """One slot: whoever is slow gets the newest observation and never an old one.

    A robot sends each picture once, so an observation that replaces one that nobody has read yet
    takes over its picture.

    Args:
        clock: The time, s; never runs backwards.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._newest: Received | None = None
        self._failure: LinkError | None = None

    @property
    def newest(self) -> Received | None:
        """The newest observation, however old; None before the first."""
        with self._changed:
            return self._newest

    def put(self, message: Observation) -> None:
        """Take in what has just arrived.

        Raises:
            LinkError: If it is not newer than what came before, so that nothing can be replayed.
        """
        with self._changed:
            last = self._newest
            if last is not None and message.seq <= last.message.seq:
                raise LinkError(
                    f"Observation {message.seq} came after {last.message.seq}: somebody replays."
                )
            jpeg = message.frame
            if jpeg is None and last is not None and message.frame_seq == last.message.frame_seq:
                jpeg = last.jpeg
            self._newest = Received(message, self._clock(), jpeg)
            self._changed.notify_all()

    def fail(self, failure: LinkError) -> None:
        """Say that nothing comes any more; the first reason stays."""
        with self._changed:
            self._failure = self._failure or failure
            self._changed.notify_all()

    def wait(self, newer_than: int, timeout_s: float) -> Received | None:
        """Wait for an observation whose `seq` is larger than `newer_than`; None for none in time.

        Raises:
            LinkError: If none can come any more.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._failure or self._is_newer(newer_than), timeout_s)
            if self._failure is not None:
                raise type(self._failure)(*self._failure.args)
            return self._newest if self._is_newer(newer_than) else None

    def take(self, newer_than: int, timeout_s: float) -> Received:
        """As `wait`, for somebody who cannot go on without.

        Raises:
            StaleObservation: If none comes in time.
            LinkError: If none can come any more.
        """
        found = self.wait(newer_than, timeout_s)
        if found is not None:
            return found
        last = self.newest
        age = f"the last came {self._clock() - last.received_at:.2f} s ago" if last else "none ever"
        raise StaleObservation(
            f"The robot sent no new observation within {timeout_s:.2f} s ({age})."
        )

    def _is_newer(self, newer_than: int) -> bool:
        return self._newest is not None and self._newest.message.seq > newer_than
