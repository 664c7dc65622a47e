"""Messages of a robot on their way from the receiving thread to the calling threads."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from shapechanger.errors import LinkError, RobotRefused, StaleObservation
from shapechanger.link.messages import Observation, Refused, RobotMessage


@dataclass(frozen=True, slots=True)
class Received:
    """An observation and its time of arrival.

    Attributes:
        message: The observation.
        received_at: Time of arrival on this machine's monotonic clock, s.
        jpeg: Frame number `message.frame_seq`, whichever message brought it; None without one.
    """

    message: Observation
    received_at: float
    jpeg: bytes | None


class Inbox:
    """Newest observation, in one slot, so that a slow reader never gets an old one.

    A robot sends each frame once, so an observation that replaces an unread one takes over its
    frame.

    Args:
        clock: Monotonic clock, s.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._newest: Received | None = None
        self._failure: LinkError | None = None

    @property
    def newest(self) -> Received | None:
        """The newest observation of any age; None before the first."""
        with self._changed:
            return self._newest

    def put(self, message: Observation) -> None:
        """Store an observation that has just arrived.

        Raises:
            LinkError: If it is not newer than the one before, as in a replay.
        """
        with self._changed:
            last = self._newest
            if last is not None and message.seq <= last.message.seq:
                raise LinkError(
                    f"Observation {message.seq} arrived after {last.message.seq}, as in a replay."
                )
            jpeg = message.frame
            if jpeg is None and last is not None and message.frame_seq == last.message.frame_seq:
                jpeg = last.jpeg
            self._newest = Received(message, self._clock(), jpeg)
            self._changed.notify_all()

    def fail(self, failure: LinkError) -> None:
        """End all waits with an error; the first one counts."""
        with self._changed:
            self._failure = self._failure or failure
            self._changed.notify_all()

    def wait(self, newer_than: int, timeout_s: float) -> Received | None:
        """Wait for an observation. Return None after the time limit.

        Args:
            newer_than: Its `seq` is larger than this.
            timeout_s: Time limit, s.

        Raises:
            LinkError: If the link is lost.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._failure or self._is_newer(newer_than), timeout_s)
            if self._failure is not None:
                raise type(self._failure)(*self._failure.args)
            return self._newest if self._is_newer(newer_than) else None

    def take(self, newer_than: int, timeout_s: float) -> Received:
        """Wait for an observation as `wait` does, and raise an error after the time limit.

        Args:
            newer_than: Its `seq` is larger than this.
            timeout_s: Time limit, s.

        Raises:
            StaleObservation: If none arrives in time.
            LinkError: If the link is lost.
        """
        found = self.wait(newer_than, timeout_s)
        if found is not None:
            return found
        last = self.newest
        age = f"the last is {self._clock() - last.received_at:.2f} s old" if last else "none ever"
        raise StaleObservation(
            f"The robot sent no new observation within {timeout_s:.2f} s ({age})."
        )

    def _is_newer(self, newer_than: int) -> bool:
        return self._newest is not None and self._newest.message.seq > newer_than


@dataclass(eq=False)
class Request:
    """A call that waits for an answer.

    Attributes:
        kind: Type of the answer.
        answer: Receives the answer.
        accepts: Returns True if a message of that type is the answer.
    """

    kind: type[RobotMessage]
    answer: Future[Any] = field(default_factory=Future[Any])
    accepts: Callable[[Any], bool] = lambda _: True


class Requests:
    """Calls that wait for an answer, oldest first."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: list[Request] = []

    def add(self, request: Request) -> None:
        """Wait for the answer to a request."""
        with self._lock:
            self._open.append(request)

    def remove(self, request: Request) -> None:
        """Wait no longer for the answer to a request."""
        with self._lock:
            if request in self._open:
                self._open.remove(request)

    def answer(self, message: RobotMessage) -> None:
        """Give a message to the first call that waits for it; a refusal answers any call."""
        refused = isinstance(message, Refused)
        with self._lock:
            request = next(
                (
                    r
                    for r in self._open
                    if refused or (isinstance(message, r.kind) and r.accepts(message))
                ),
                None,
            )
            if request is None:
                return
            self._open.remove(request)
        if isinstance(message, Refused):
            request.answer.set_exception(RobotRefused(message.reason))
        else:
            request.answer.set_result(message)

    def fail(self, failure: LinkError) -> None:
        """End all calls with an error."""
        with self._lock:
            requests, self._open = self._open, []
        for request in requests:
            request.answer.set_exception(failure)
