"""Messages of a robot on their way from the connection's thread to the calling threads."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from shapechanger.errors import LinkError, RobotRefused, StaleObservation
from shapechanger.robot.link.messages import (
    Event,
    Observation,
    PolicyState,
    RecorderState,
    Refused,
    RobotMessage,
)

_Answer = TypeVar("_Answer", bound=RobotMessage)

_MAX_EVENTS: Final = 256


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
    """Messages of a robot, for any number of calling threads.

    The newest observation is in one slot, so that a slow reader never gets an old one. A robot
    sends each frame once, so an observation that replaces an unread one takes over its frame.

    Attributes:
        newest: The newest observation of any age; None before the first.
        recorder: Last reported state of the robot's recorder, or None.
        policies: Last report of the policies on board, or None.
        failure: Why the link is lost; None while it is up.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self.newest: Received | None = None
        self.recorder: RecorderState | None = None
        self.policies: PolicyState | None = None
        self.failure: LinkError | None = None
        self._clock = clock
        self._changed = threading.Condition()
        self._events: deque[Event] = deque(maxlen=_MAX_EVENTS)
        self._refusals: dict[int, str] = {}
        self._expected: list[tuple[type[Any], Callable[[Any], bool], Future[Any]]] = []

    def put(self, message: RobotMessage) -> None:
        """Store a message that has just arrived."""
        with self._changed:
            match message:
                case Observation():
                    self._observe(message)
                case Event():
                    self._events.append(message)
                case Refused(fatal=True):
                    raise RobotRefused(message.reason)
                case Refused(seq=int(seq)):
                    self._refusals = {seq: message.reason}
                case _:
                    if isinstance(message, RecorderState):
                        self.recorder = message
                    elif isinstance(message, PolicyState):
                        self.policies = message
                    self._answer(message)
            self._changed.notify_all()

    def fail(self, failure: LinkError) -> None:
        """End all waits with an error; the first one counts."""
        with self._changed:
            self.failure = self.failure or failure
            for *_, future in self._expected:
                if future.set_running_or_notify_cancel():
                    future.set_exception(type(self.failure)(*self.failure.args))
            self._expected.clear()
            self._changed.notify_all()

    def check(self) -> None:
        """Do nothing while the link is up."""
        if self.failure is not None:
            raise type(self.failure)(*self.failure.args)

    def wait(self, newer_than: int, timeout_s: float) -> Received | None:
        """Wait for an observation. Return None after the time limit."""

        def found() -> Received | None:
            newest = self.newest
            return newest if newest is not None and newest.message.seq > newer_than else None

        with self._changed:
            self._changed.wait_for(lambda: self.failure or found(), timeout_s)
            self.check()
            return found()

    def take(self, newer_than: int, timeout_s: float) -> Received:
        """Wait for an observation as `wait` does, and raise an error after the time limit."""
        found = self.wait(newer_than, timeout_s)
        if found is not None:
            return found
        last = self.newest
        age = f"the last is {self._clock() - last.received_at:.2f} s old" if last else "none ever"
        raise StaleObservation(
            f"The robot sent no new observation within {timeout_s:.2f} s ({age})."
        )

    def expect(
        self, kind: type[_Answer], accepts: Callable[[_Answer], bool] = lambda _: True
    ) -> Future[_Answer]:
        """Return the future answer to a request that is sent next; cancel one that is given up.

        A refusal answers the oldest request, and a lost link all of them, with its error.
        """
        future: Future[_Answer] = Future()
        with self._changed:
            self.check()
            self._expected = [one for one in self._expected if not one[2].done()]
            self._expected.append((kind, accepts, future))
        return future

    def events(self) -> list[Event]:
        """Return the events since the last call, oldest first, at most 256."""
        with self._changed:
            events = list(self._events)
            self._events.clear()
        return events

    def refusal(self, seq: int) -> str:
        """Return the reason why the robot refused a command, or "" if it has not."""
        return self._refusals.get(seq, "")

    def _answer(self, message: RobotMessage) -> None:
        """Give a message to the oldest request that it answers."""
        for one in list(self._expected):
            kind, accepts, future = one
            is_refusal = isinstance(message, Refused)
            if not is_refusal and not (isinstance(message, kind) and accepts(message)):
                continue
            self._expected.remove(one)
            if future.set_running_or_notify_cancel():  # False for one that was given up.
                if is_refusal:
                    future.set_exception(RobotRefused(message.reason))
                else:
                    future.set_result(message)
                return

    def _observe(self, message: Observation) -> None:
        last = self.newest
        if last is not None and message.seq <= last.message.seq:
            raise LinkError(
                f"Observation {message.seq} arrived after {last.message.seq}, as in a replay."
            )
        jpeg = message.frame
        if jpeg is None and last is not None and message.frame_seq == last.message.frame_seq:
            jpeg = last.jpeg
        self.newest = Received(message, self._clock(), jpeg)
