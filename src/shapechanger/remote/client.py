"""A robot as a program sees it: command, observe, stop; no `await` in sight.

>>> with RobotClient.connect(recall("new-bright")) as robot:
...     robot.take()
...     robot.arm()
...     seen = robot.observation()
...     robot.command((0.0, 0.3), answers=seen.message.seq)
"""

from __future__ import annotations

import asyncio
import contextlib
import getpass
import os
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from dataclasses import dataclass, field
from typing import Any, Final, Self

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.link import messages
from shapechanger.link.address import parse_address
from shapechanger.link.authentication import parse_key
from shapechanger.link.messages import ClientMessage, Event, RobotMessage, Welcome
from shapechanger.remote.connection import Access, RobotConnection, open_connection
from shapechanger.remote.inbox import Inbox, Received
from shapechanger.remote.known_robots import KnownRobot, parse_trust, untrusted

__all__ = ["RobotClient"]

_MOST_EVENTS: Final = 256
# How long a call may take beyond the link's own limit, s.
_MARGIN_S: Final = 2.0
# How long a robot may look for an answer on its disk, s.
_DISK_S: Final = 30.0


@dataclass
class _Question:
    """What somebody waits for.

    Attributes:
        kind: Kind of the answer.
        answer: Where it goes.
        accepts: Whether a message of that kind is the answer.
    """

    kind: type[RobotMessage]
    answer: Future[Any] = field(default_factory=Future[Any])
    accepts: Callable[[Any], bool] = lambda _: True


def _own_name() -> str:
    """Who connects, where nobody says it: the user and the host."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # In a container there may be none.
        user = "somebody"
    return f"{user}@{socket.gethostname()}"[:64]


def _here(failure: LinkError) -> LinkError:
    """The same failure without the calls of the thread that met it, which help nobody."""
    return type(failure)(*failure.args)


class RobotClient:
    """A connection to a robot, kept by one thread of its own.

    All methods may be called from any thread. Whatever cannot be done is a `LinkError`, or
    `RobotRefused` where the robot itself says no.

    Args:
        access: Who connects to what, and how.
        clock: This machine's time, s; never runs backwards.

    Raises:
        RobotRefused: If the robot is another one than expected, or does not want us.
        LinkError: If nobody answers, or nobody who speaks as we do.
    """

    def __init__(self, access: Access, clock: Callable[[], float] = time.monotonic) -> None:
        self._access = access
        self._clock = clock
        self._process = os.getpid()
        self._inbox = Inbox(clock)
        self._lock = threading.Lock()
        self._questions: list[_Question] = []
        self._events: deque[Event] = deque(maxlen=_MOST_EVENTS)
        self._refusals: dict[int, str] = {}
        self._recorder: messages.RecorderState | None = None
        self._asking = threading.Lock()
        self._seq = 0
        self._failure: LinkError | None = None
        self._ready: Future[Welcome] = Future()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop = asyncio.Event()
        self._connection: RobotConnection | None = None
        self._thread = threading.Thread(
            target=self._keep, name=f"robot {access.address}", daemon=True
        )
        self._thread.start()
        try:
            self._welcome = self._ready.result()
        except LinkError as failure:
            self.close()
            raise _here(failure) from None
        except BaseException:  # Ctrl-C too: no thread stays behind.
            self.close()
            raise

    @classmethod
    def connect(
        cls,
        robot: KnownRobot | str,
        *,
        key: str = "",
        fingerprint: str = "",
        role: messages.Role = "program",
        name: str = "",
        pace: messages.Pace = "realtime",
        frames: bool = True,
        timeout_s: float = 2.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> Self:
        """Connect to a robot.

        Args:
            robot: One that is remembered, see `shapechanger.remote.known_robots.recall`; or an address,
                as HOST or HOST:PORT.
            key: The robot's key, for an address.
            fingerprint: SHA-256 of its certificate, for an address; "insecure" for no encryption.
            role: Who drives.
            name: Who connects, for people to read; the user and the host, by default.
            pace: Who keeps the time.
            frames: Whether observations shall carry pictures.
            timeout_s: How long the handshake may take, and silence last until the link is lost.
            clock: This machine's time, s.

        Raises:
            RobotRefused: If the robot is another one than expected, or does not want us.
            LinkError: If nobody answers; without a fingerprint, with the one that is shown there.
        """
        if not timeout_s > 0.0:
            raise LinkError(f"The link's timeout is more than 0 s, got timeout_s={timeout_s:g}.")
        if not isinstance(robot, KnownRobot):
            if not fingerprint:
                raise untrusted(parse_address(robot), timeout_s)
            robot = KnownRobot("robot", robot, key, fingerprint)
        access = Access(
            parse_address(robot.address),
            parse_key(robot.key) if robot.key else b"",
            parse_trust(robot.fingerprint),
            name or _own_name(),
            role,
            pace,
            frames,
            timeout_s,
        )
        return cls(access, clock)

    @property
    def welcome(self) -> Welcome:
        """What the robot is."""
        return self._welcome

    @property
    def pace(self) -> messages.Pace:
        """Who keeps the time."""
        return self._access.pace

    @property
    def alive(self) -> bool:
        """Whether the link stands, in this process."""
        return self._failure is None and self._process == os.getpid()

    @property
    def newest(self) -> Received | None:
        """The newest observation, however old; None before the first."""
        return self._inbox.newest

    @property
    def recorder(self) -> messages.RecorderState | None:
        """What the robot said last of its recorder; None for nothing yet."""
        return self._recorder

    def take(self) -> None:
        """Be the one who commands.

        Raises:
            RobotRefused: If somebody else does, and keeps to it.
        """
        lease: messages.Lease = self._ask(messages.Take(), messages.Lease)
        if not lease.mine:
            raise RobotRefused(lease.reason or f"{lease.holder or 'Somebody'} commands the robot.")

    def arm(self) -> None:
        """Let the outputs move; a person also ends an emergency stop that was seen before.

        Raises:
            RobotRefused: If the robot says no, or does not say yes in time.
        """
        seen = self.newest or self.ask()
        # It answers what is true now, and ends only what was known before.
        newest = self.ask()
        refusal = _Question(messages.Refused)
        with self._lock:
            self._questions.append(refusal)
        self._post(messages.Arm(answers=newest.message.seq, emergency=seen.message.emergencies))
        until = self._clock() + self._access.timeout_s
        try:
            while self._clock() < until:
                newest = self.ask()
                if refusal.answer.done():
                    refusal.answer.result()
                if newest.message.armed:
                    return
        finally:
            self._forget(refusal)
        reason = newest.message.stop_reason
        raise RobotRefused(f"The robot did not arm{f': {reason}' if reason else ''}.")

    def command(
        self,
        values: Sequence[float],
        *,
        answers: int,
        ttl_ms: int | None = None,
        scale: float = 1.0,
    ) -> int:
        """Say what to do, until the next command or until it is too old.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            answers: `seq` of the observation that it was decided on.
            ttl_ms: How long it may act; None for as long as the robot allows.
            scale: A cap of one's own, 0 to 1, times the values.

        Returns:
            The number of the command.
        """
        with self._lock:
            self._seq += 1
            seq = self._seq
        ttl_ms = self._welcome.deadline_ms if ttl_ms is None else ttl_ms
        told = tuple(float(value) for value in values)
        self._post(
            messages.Command(seq=seq, answers=answers, values=told, ttl_ms=ttl_ms, scale=scale)
        )
        return seq

    def suggest(self, values: Sequence[float], *, answers: int) -> int:
        """Say what to do while somebody else commands; the robot shows it, and does not do it.

        It counts as long as a command would, and asks for the next observation as one does.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            answers: `seq` of the observation that it was decided on.

        Returns:
            The number of the suggestion, to ask `refusal` for.
        """
        with self._lock:
            self._seq += 1
            seq = self._seq
        told = tuple(float(value) for value in values)
        self._post(messages.Suggest(seq=seq, answers=answers, values=told))
        return seq

    def acknowledge(self) -> None:
        """Ask for the next observation without commanding anything."""
        newest = self.newest
        self._post(messages.Acknowledge(seq=newest.message.seq if newest else 0))

    def observation(self, newer_than: int = 0, timeout_s: float | None = None) -> Received:
        """The newest observation whose `seq` is larger than `newer_than`; waits for it.

        Raises:
            StaleObservation: If none comes in time.
            LinkError: If the link is lost.
        """
        self._require_alive()
        return self._inbox.take(newer_than, self._limit(timeout_s))

    def newer(self, newer_than: int, timeout_s: float) -> Received | None:
        """As `observation`, but None where none comes in time.

        Raises:
            LinkError: If the link is lost.
        """
        self._require_alive()
        return self._inbox.wait(newer_than, timeout_s)

    def ask(self) -> Received:
        """An observation that comes after all that was seen.

        Raises:
            LinkError: If none comes in time, or the link is lost.
        """
        newest = self.newest
        self.acknowledge()
        return self.observation(newest.message.seq if newest else 0)

    def exchange(self, values: Sequence[float], seen: Received) -> Received:
        """Command in answer to an observation, and wait for the next one.

        Raises:
            LinkError: If none comes in time, or the link is lost.
        """
        self.command(values, answers=seen.message.seq)
        return self.observation(seen.message.seq)

    def emergency_stop(self, reason: str = "") -> None:
        """Stop everything, whoever commands, until a person arms the robot again."""
        self._post(messages.EmergencyStop(reason=reason))

    def disarm(self) -> None:
        """Keep the outputs at rest from now on."""
        self._post(messages.Disarm())

    def release(self) -> None:
        """Give the command back; the robot stops and disarms."""
        self._post(messages.Release())

    def record(self, on: bool = True, name: str = "") -> messages.RecorderState:
        """Begin an episode on the robot's disk, or end it; only a person may.

        Args:
            on: Whether to record from now on.
            name: What it is about, for people to read.

        Raises:
            RobotRefused: If the robot does not record, as on a full disk; or records already.
            LinkError: If it does not answer in time.
        """
        return self._ask_recorder(
            messages.Record(on=on, name=name),
            lambda state: state.recording == on and bool(state.episode),
        )

    def mark(self, text: str = "") -> messages.RecorderState:
        """Mark the newest step of the episode that is being recorded; errors as of `record`."""
        before = 0 if self._recorder is None else self._recorder.marks
        return self._ask_recorder(messages.Mark(text=text), lambda state: state.marks > before)

    def undo(self, seconds: float = 5.0) -> messages.RecorderState:
        """Drop the newest steps of the episode that is being recorded; errors as of `record`.

        Args:
            seconds: How far back, s; above 0.
        """
        before = 0 if self._recorder is None else self._recorder.dropped
        return self._ask_recorder(
            messages.Undo(seconds=seconds), lambda state: state.dropped > before
        )

    def browse(self, before: str = "", timeout_s: float = _DISK_S) -> messages.Recordings:
        """What was recorded on the robot, newest first.

        Args:
            before: Only episodes whose id sorts before this one; "" for the newest.
            timeout_s: How long the robot may look, s.

        Raises:
            RobotRefused: If it keeps no recordings.
            LinkError: If it does not answer in time.
        """
        return self._ask_library(messages.Browse(before=before), messages.Recordings, timeout_s)

    def fetch(
        self, episode: str, first: int = 0, count: int = 1_000, timeout_s: float = _DISK_S
    ) -> messages.Piece:
        """A part of an episode, as it is on the robot's disk; errors as of `browse`.

        Args:
            episode: Its id.
            first: Number of the first line, from 0.
            count: How many lines at most; fewer come where they would be too large.
            timeout_s: How long the robot may look, s.
        """
        asked = messages.Fetch(episode=episode, first=first, count=count)
        return self._ask_library(asked, messages.Piece, timeout_s)

    def judge(
        self, episode: str, first: int, last: int, *, keep: bool, timeout_s: float = _DISK_S
    ) -> messages.EpisodeSummary:
        """Say whether steps of an episode are to be learned from; only a person may.

        Args:
            episode: Its id.
            first: Number of the first step.
            last: Number of the last step, which counts too.
            keep: Whether they are good.
            timeout_s: How long the robot may look, s.

        Returns:
            The episode as it is then.

        Raises:
            RobotRefused: If there are no such steps, or it is being recorded.
            LinkError: If the robot does not answer in time.
        """
        asked = messages.Judge(episode=episode, first=first, last=last, keep=keep)
        found: messages.Recordings = self._ask_library(asked, messages.Recordings, timeout_s)
        return found.episodes[0]

    def ping(self, timeout_s: float | None = None) -> tuple[float, int]:
        """Ask whether anybody is there.

        Returns:
            How long the answer took, s, and the robot's time when it answered, ns.
        """
        asked_at = self._clock()
        pong: messages.Pong = self._ask(messages.Ping(), messages.Pong, timeout_s)
        return self._clock() - asked_at, pong.now_ns

    def events(self) -> list[Event]:
        """What happened since the last call, oldest first; the last 256 at most."""
        with self._lock:
            events = list(self._events)
            self._events.clear()
        return events

    def refusal(self, seq: int) -> str:
        """Why the robot refused a command, in words; "" if it did not, or has not said so yet."""
        with self._lock:
            return self._refusals.get(seq, "")

    def close(self) -> None:
        """End the connection, after what was said has left; again does nothing."""
        if self._process != os.getpid():
            return  # A copy made by fork: the connection is the other process's.
        self._fail(LinkError("The connection was closed here: make a new one."))
        loop = self._loop
        if loop is not None and not loop.is_closed():
            with contextlib.suppress(RuntimeError):  # It may close in between.
                loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    def abandon(self) -> None:
        """As `release` and `close`, but without waiting for anything or taking a lock.

        For whoever is dropped without being closed: the garbage collector may call this in any
        thread, in this connection's own too.
        """
        loop, made = self._loop, self._connection
        if self._process != os.getpid() or loop is None or made is None:
            return
        with contextlib.suppress(RuntimeError):  # It has ended already.
            loop.call_soon_threadsafe(made.post, messages.Release())
            loop.call_soon_threadsafe(self._stop.set)

    def __enter__(self) -> Self:
        """The client itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the connection."""
        self.close()

    # Of the caller's threads.

    def _limit(self, timeout_s: float | None) -> float:
        return self._access.timeout_s + _MARGIN_S if timeout_s is None else timeout_s

    def _require_alive(self) -> None:
        if self._process != os.getpid():
            raise LinkError("This connection belongs to another process: make one in this one.")
        if self._failure is not None:
            raise _here(self._failure)

    def _post(self, message: ClientMessage) -> None:
        self._require_alive()
        if self._loop is None or self._connection is None:
            raise LinkError("The connection is not made yet.")
        try:
            self._loop.call_soon_threadsafe(self._connection.post, message)
        except RuntimeError:  # The loop ended since.
            failure = self._failure or LinkError("The link to the robot is lost.")
            raise _here(failure) from None

    def _ask_recorder(
        self, message: ClientMessage, accepts: Callable[[messages.RecorderState], bool]
    ) -> messages.RecorderState:
        messages.decode_client_message(messages.encode(message))  # What is wrong is said here.
        with self._asking:
            return self._ask(message, messages.RecorderState, _DISK_S, accepts)

    def _ask_library(
        self, message: ClientMessage, kind: type[RobotMessage], timeout_s: float
    ) -> Any:
        messages.decode_client_message(messages.encode(message))
        with self._asking:  # A robot answers one such question at a time.
            return self._ask(message, kind, timeout_s)

    def _ask(
        self,
        message: ClientMessage,
        kind: type[RobotMessage],
        timeout_s: float | None = None,
        accepts: Callable[[Any], bool] = lambda _: True,
    ) -> Any:
        question = _Question(kind, accepts=accepts)
        with self._lock:
            self._questions.append(question)
        try:
            self._post(message)
            return question.answer.result(self._limit(timeout_s))
        except FutureTimeout:
            asked = type(message).__name__
            raise LinkError(f"The robot did not answer to {asked!r} in time.") from None
        except LinkError as failure:
            raise _here(failure) from None
        finally:
            self._forget(question)

    def _forget(self, question: _Question) -> None:
        with self._lock:
            if question in self._questions:
                self._questions.remove(question)

    # Of the thread that keeps the connection.

    def _keep(self) -> None:
        try:
            asyncio.run(self._live())
        except LinkError as error:
            self._fail(error)
        except BaseException as error:
            # Whoever waits must learn of it; the thread is the last that could tell.
            self._fail(LinkError(f"The link to the robot broke: {error!r}."))
            raise
        else:
            self._fail(LinkError("The connection was closed here: make a new one."))

    async def _live(self) -> None:
        self._loop = asyncio.get_running_loop()
        async with open_connection(self._access) as made:
            self._connection = made
            self._ready.set_result(made.welcome)
            await made.run(self._handle, self._stop)

    def _handle(self, message: RobotMessage) -> None:
        """Put a message where it belongs.

        Raises:
            LinkError: If it ends the link.
        """
        if isinstance(message, messages.Observation):
            self._inbox.put(message)
            return
        if isinstance(message, messages.Event):
            with self._lock:
                self._events.append(message)
            return
        if isinstance(message, messages.RecorderState):
            self._recorder = message
        if isinstance(message, messages.Refused):
            if message.fatal:
                raise RobotRefused(message.reason)
            if message.seq is not None:
                with self._lock:
                    self._refusals = {message.seq: message.reason}
                return
        self._answer(message)

    def _answer(self, message: RobotMessage) -> None:
        """Hand an answer to the first who waits for it; a refusal is an answer to anything."""
        refused = isinstance(message, messages.Refused)
        with self._lock:
            question = next(
                (
                    q
                    for q in self._questions
                    if refused or (isinstance(message, q.kind) and q.accepts(message))
                ),
                None,
            )
            if question is None:
                return
            self._questions.remove(question)
        if isinstance(message, messages.Refused):
            question.answer.set_exception(RobotRefused(message.reason))
        else:
            question.answer.set_result(message)

    def _fail(self, failure: LinkError) -> None:
        with self._lock:
            self._failure = self._failure or failure
            failure = self._failure
            questions, self._questions = self._questions, []
        self._inbox.fail(failure)
        if not self._ready.done():
            self._ready.set_exception(failure)
        for question in questions:
            question.answer.set_exception(failure)
