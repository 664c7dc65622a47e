"""Synchronous client of a robot: command, observe, stop.

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
from typing import Any, Final, Self

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.link import messages
from shapechanger.link.address import parse_address
from shapechanger.link.authentication import parse_key
from shapechanger.link.messages import ClientMessage, Event, RobotMessage, Welcome
from shapechanger.remote.connection import Access, RobotConnection, open_connection
from shapechanger.remote.inbox import Inbox, Received, Request, Requests
from shapechanger.remote.known_robots import KnownRobot, parse_trust, untrusted

_MAX_EVENTS: Final = 256
_MARGIN_S: Final = 2.0  # Of a call beyond the link's own time limit, s.
_DISK_S: Final = 30.0  # Time that a robot may take to read its disk, s.


def _own_name() -> str:
    """Return the default name of a client: user and host."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # A container may have no user name.
        user = "unknown"
    return f"{user}@{socket.gethostname()}"[:64]


def _check(message: ClientMessage) -> None:
    """Raise a `LinkError` for a field out of range before anything is sent."""
    messages.decode_client_message(messages.encode(message))


def _copy(failure: LinkError) -> LinkError:
    """Return the same error without the traceback of the connection's thread."""
    return type(failure)(*failure.args)


class RobotClient:
    """Connection to a robot, kept by a thread of its own.

    All methods may be called from any thread. Failures are `LinkError`, or `RobotRefused` where
    the robot refuses.

    Args:
        access: Settings of the connection.
        clock: Monotonic clock of this machine, s.

    Raises:
        RobotRefused: If the robot's certificate differs, or it refuses the client.
        LinkError: If no robot answers, or one with another version of the link.
    """

    def __init__(self, access: Access, clock: Callable[[], float] = time.monotonic) -> None:
        self._access = access
        self._clock = clock
        self._process = os.getpid()
        self._inbox = Inbox(clock)
        self._lock = threading.Lock()
        self._requests = Requests()
        self._events: deque[Event] = deque(maxlen=_MAX_EVENTS)
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
            raise _copy(failure) from None
        except BaseException:  # Ctrl-C too: leave no thread behind.
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
            robot: A known robot, from `shapechanger.remote.known_robots.recall`; or an address,
                HOST or HOST:PORT.
            key: The robot's key, for an address.
            fingerprint: SHA-256 of its certificate, for an address; "insecure" for no encryption.
            role: Whether a person or a program drives.
            name: Display name of the client; user and host by default.
            pace: Whether the clocks or the client set the pace.
            frames: Whether observations carry frames.
            timeout_s: Time limit of the handshake, and of silence before the link is lost, s.
            clock: Monotonic clock of this machine, s.

        Raises:
            RobotRefused: If the robot's certificate differs, or it refuses the client.
            LinkError: If no robot answers. Without a fingerprint the message shows the robot's.
        """
        if not timeout_s > 0.0:
            raise LinkError(f"timeout_s must be above 0, got {timeout_s:g}.")
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
        """Description of the robot."""
        return self._welcome

    @property
    def pace(self) -> messages.Pace:
        """Return whether the clocks or the client set the pace."""
        return self._access.pace

    @property
    def alive(self) -> bool:
        """True while the link is up, in the process that made it."""
        return self._failure is None and self._process == os.getpid()

    @property
    def newest(self) -> Received | None:
        """The newest observation of any age; None before the first."""
        return self._inbox.newest

    @property
    def recorder(self) -> messages.RecorderState | None:
        """Last reported state of the robot's recorder, or None."""
        return self._recorder

    def take(self) -> None:
        """Take control.

        Raises:
            RobotRefused: If another client keeps control.
        """
        lease: messages.Lease = self._ask(messages.Take(), messages.Lease)
        if not lease.mine:
            raise RobotRefused(lease.reason or f"{lease.holder or 'Another client'} has control.")

    def arm(self) -> None:
        """Let the outputs move; from a person this also ends an emergency stop seen before.

        Raises:
            RobotRefused: If the robot refuses, or is not armed in time.
        """
        seen = self.newest or self.ask()
        # Answer a new observation, but end only an emergency stop that was seen before the call.
        newest = self.ask()
        refusal = Request(messages.Refused)
        self._requests.add(refusal)
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
            self._requests.remove(refusal)
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
        """Send a command, in force until the next one or until it expires.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            answers: `seq` of the observation that the command answers.
            ttl_ms: Lifetime, ms; None for the robot's deadline.
            scale: Cap, 0 to 1, by which the values are multiplied.

        Returns:
            The number of the command.
        """
        with self._lock:
            self._seq += 1
            seq = self._seq
        ttl_ms = self._welcome.deadline_ms if ttl_ms is None else ttl_ms
        floats = tuple(float(value) for value in values)
        self._post(
            messages.Command(seq=seq, answers=answers, values=floats, ttl_ms=ttl_ms, scale=scale)
        )
        return seq

    def suggest(self, values: Sequence[float], *, answers: int) -> int:
        """Send a suggestion while another client has control; the robot only shows it.

        A suggestion lives as long as a command, and asks for the next observation as one does.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            answers: `seq` of the observation that the suggestion answers.

        Returns:
            The number of the suggestion, for `refusal`.
        """
        with self._lock:
            self._seq += 1
            seq = self._seq
        floats = tuple(float(value) for value in values)
        self._post(messages.Suggest(seq=seq, answers=answers, values=floats))
        return seq

    def acknowledge(self) -> None:
        """Ask for the next observation without a command."""
        newest = self.newest
        self._post(messages.Acknowledge(seq=newest.message.seq if newest else 0))

    def observation(self, newer_than: int = 0, timeout_s: float | None = None) -> Received:
        """Wait for an observation, and return the newest one.

        Args:
            newer_than: Its `seq` is larger than this.
            timeout_s: Time limit, s; None for that of the link.

        Raises:
            StaleObservation: If none arrives in time.
            LinkError: If the link is lost.
        """
        self._require_alive()
        return self._inbox.take(newer_than, self._limit(timeout_s))

    def newer(self, newer_than: int, timeout_s: float) -> Received | None:
        """Wait for an observation as `observation` does, but return None after the time limit.

        Args:
            newer_than: Its `seq` is larger than this.
            timeout_s: Time limit, s.

        Raises:
            LinkError: If the link is lost.
        """
        self._require_alive()
        return self._inbox.wait(newer_than, timeout_s)

    def ask(self) -> Received:
        """Ask for a new observation, and wait for it.

        Raises:
            LinkError: If none arrives in time, or the link is lost.
        """
        newest = self.newest
        self.acknowledge()
        return self.observation(newest.message.seq if newest else 0)

    def exchange(self, values: Sequence[float], seen: Received) -> Received:
        """Send a command, and wait for the next observation.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            seen: The observation that the command answers.

        Raises:
            LinkError: If none arrives in time, or the link is lost.
        """
        self.command(values, answers=seen.message.seq)
        return self.observation(seen.message.seq)

    def emergency_stop(self, reason: str = "") -> None:
        """Stop all outputs, without control too, until a person arms the robot again."""
        self._post(messages.EmergencyStop(reason=reason))

    def disarm(self) -> None:
        """Keep the outputs at rest."""
        self._post(messages.Disarm())

    def release(self) -> None:
        """Give control back; the robot stops and disarms."""
        self._post(messages.Release())

    def record(self, on: bool = True, name: str = "") -> messages.RecorderState:
        """Begin or end an episode on the robot's disk; only as a person.

        Args:
            on: Whether to record.
            name: Title of the episode.

        Raises:
            RobotRefused: If the robot cannot record, as on a full disk, or records already.
            LinkError: If it does not answer in time.
        """
        return self._ask_recorder(
            messages.Record(on=on, name=name),
            lambda state: state.recording == on and bool(state.episode),
        )

    def mark(self, text: str = "") -> messages.RecorderState:
        """Mark the newest step of the episode being recorded; raises as `record` does."""
        before = 0 if self._recorder is None else self._recorder.marks
        return self._ask_recorder(messages.Mark(text=text), lambda state: state.marks > before)

    def undo(self, seconds: float = 5.0) -> messages.RecorderState:
        """Drop the newest steps of the episode being recorded; raises as `record` does.

        Args:
            seconds: How far back, s, above 0.
        """
        before = 0 if self._recorder is None else self._recorder.dropped
        return self._ask_recorder(
            messages.Undo(seconds=seconds), lambda state: state.dropped > before
        )

    def browse(self, before: str = "", timeout_s: float = _DISK_S) -> messages.Recordings:
        """List the episodes on the robot, newest first.

        Args:
            before: Only episodes whose id sorts before this one; "" for the newest.
            timeout_s: Time limit, s.

        Raises:
            RobotRefused: If the robot has no folder for recordings.
            LinkError: If it does not answer in time.
        """
        return self._ask_library(messages.Browse(before=before), messages.Recordings, timeout_s)

    def fetch(
        self, episode: str, first: int = 0, count: int = 1_000, timeout_s: float = _DISK_S
    ) -> messages.Piece:
        """Read a part of an episode on the robot's disk; raises as `browse` does.

        Args:
            episode: Id of the episode.
            first: Number of the first line, from 0.
            count: Most lines to read; fewer are sent where the message would be too large.
            timeout_s: Time limit, s.
        """
        request = messages.Fetch(episode=episode, first=first, count=count)
        return self._ask_library(request, messages.Piece, timeout_s)

    def judge(
        self, episode: str, first: int, last: int, *, keep: bool, timeout_s: float = _DISK_S
    ) -> messages.EpisodeSummary:
        """Keep or drop steps of an episode; only as a person.

        Args:
            episode: Id of the episode.
            first: Number of the first step.
            last: Number of the last step, inclusive.
            keep: Whether to use the steps for training.
            timeout_s: Time limit, s.

        Returns:
            The episode after the change.

        Raises:
            RobotRefused: If there are no such steps, or the episode is being recorded.
            LinkError: If the robot does not answer in time.
        """
        request = messages.Judge(episode=episode, first=first, last=last, keep=keep)
        found: messages.Recordings = self._ask_library(request, messages.Recordings, timeout_s)
        return found.episodes[0]

    def ping(self, timeout_s: float | None = None) -> tuple[float, int]:
        """Measure the round trip.

        Returns:
            The round trip, s, and the robot's time at its answer, ns.
        """
        start = self._clock()
        pong: messages.Pong = self._ask(messages.Ping(), messages.Pong, timeout_s)
        return self._clock() - start, pong.now_ns

    def events(self) -> list[Event]:
        """Return the events since the last call, oldest first, at most 256."""
        with self._lock:
            events = list(self._events)
            self._events.clear()
        return events

    def refusal(self, seq: int) -> str:
        """Return the reason why the robot refused a command, or "" if it has not."""
        with self._lock:
            return self._refusals.get(seq, "")

    def close(self) -> None:
        """End the connection after pending messages are sent; may be called again."""
        if self._process != os.getpid():
            return  # A copy made by fork: the connection belongs to the other process.
        self._fail(LinkError("The connection was closed: make a new one."))
        loop = self._loop
        if loop is not None and not loop.is_closed():
            with contextlib.suppress(RuntimeError):  # It may close in between.
                loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    def abandon(self) -> None:
        """Release and close without waiting or taking a lock.

        For clients that are dropped without `close`: the garbage collector may call this in any
        thread, including that of the connection.
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

    # In the callers' threads.

    def _limit(self, timeout_s: float | None) -> float:
        return self._access.timeout_s + _MARGIN_S if timeout_s is None else timeout_s

    def _require_alive(self) -> None:
        if self._process != os.getpid():
            raise LinkError("This connection belongs to another process: make one in this one.")
        if self._failure is not None:
            raise _copy(self._failure)

    def _post(self, message: ClientMessage) -> None:
        self._require_alive()
        if self._loop is None or self._connection is None:
            raise LinkError("The connection is not open yet.")
        try:
            self._loop.call_soon_threadsafe(self._connection.post, message)
        except RuntimeError:  # The loop has ended meanwhile.
            failure = self._failure or LinkError("The link to the robot is lost.")
            raise _copy(failure) from None

    def _ask_recorder(
        self, message: ClientMessage, accepts: Callable[[messages.RecorderState], bool]
    ) -> messages.RecorderState:
        _check(message)
        with self._asking:
            return self._ask(message, messages.RecorderState, _DISK_S, accepts)

    def _ask_library(
        self, message: ClientMessage, kind: type[RobotMessage], timeout_s: float
    ) -> Any:
        _check(message)
        with self._asking:  # A robot answers one such question at a time.
            return self._ask(message, kind, timeout_s)

    def _ask(
        self,
        message: ClientMessage,
        answer: type[RobotMessage],
        timeout_s: float | None = None,
        accepts: Callable[[Any], bool] = lambda _: True,
    ) -> Any:
        request = Request(answer, accepts=accepts)
        self._requests.add(request)
        try:
            self._post(message)
            return request.answer.result(self._limit(timeout_s))
        except FutureTimeout:
            kind = type(message).__name__
            raise LinkError(f"The robot did not answer {kind!r} in time.") from None
        except LinkError as failure:
            raise _copy(failure) from None
        finally:
            self._requests.remove(request)

    # In the connection's thread.

    def _keep(self) -> None:
        try:
            asyncio.run(self._live())
        except LinkError as error:
            self._fail(error)
        except BaseException as error:
            # Callers that wait must not wait for ever.
            self._fail(LinkError(f"The link to the robot failed: {error!r}."))
            raise
        else:
            self._fail(LinkError("The connection was closed: make a new one."))

    async def _live(self) -> None:
        self._loop = asyncio.get_running_loop()
        async with open_connection(self._access) as made:
            self._connection = made
            self._ready.set_result(made.welcome)
            await made.run(self._handle, self._stop)

    def _handle(self, message: RobotMessage) -> None:
        """Handle a message of the robot.

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
        self._requests.answer(message)

    def _fail(self, failure: LinkError) -> None:
        with self._lock:
            self._failure = self._failure or failure
            failure = self._failure
        self._inbox.fail(failure)
        if not self._ready.done():
            self._ready.set_exception(failure)
        self._requests.fail(failure)
