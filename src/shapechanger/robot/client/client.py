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
import itertools
import os
import socket
import threading
import time
from collections.abc import Callable, Sequence
from typing import Final, Self, TypeVar

import aiohttp

from shapechanger.errors import LinkError, RobotRefused, translate_errors
from shapechanger.robot.client import connection
from shapechanger.robot.client.connection import Inbox, Received
from shapechanger.robot.client.known_robots import KnownRobot, untrusted
from shapechanger.robot.link import messages
from shapechanger.robot.link.address import parse_address
from shapechanger.robot.link.messages import ClientMessage, Hello, RobotMessage, Welcome

_Answer = TypeVar("_Answer", bound=RobotMessage)

_MARGIN_S: Final = 2.0  # Time that a call waits beyond the link's time limit, s.
# Fractions of the silence timeout: when to send a ping, and how often to check.
_PING_AFTER: Final = 0.4
_CHECK_EVERY: Final = 0.1
_DISK_S: Final = 30.0  # Time that a robot may take to read or write its disk, s.


class RobotClient(Inbox):
    """Connection to a robot, made by `connect` and maintained by a background thread.

    All methods may be called from any thread. Those that wait for an answer raise `RobotRefused` if
    the robot refuses, and `LinkError` if no answer arrives in time. Those that send raise
    `LinkError` if the link is lost; `refusal` states whether a command was refused.

    Attributes:
        welcome: Description of the robot.
        pace: "realtime", or "lockstep" if the robot waits for each command of the client.
    """

    def __init__(self, robot: KnownRobot, hello: Hello, timeout_s: float) -> None:
        super().__init__(time.monotonic, timeout_s + _MARGIN_S)
        self.pace = hello.pace
        self._settings = robot, hello, timeout_s
        self._asking = threading.Lock()
        self._numbers = itertools.count(1)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop = asyncio.Event()
        self._posted = asyncio.Event()
        self._pending: list[ClientMessage] = []
        self._thread = threading.Thread(
            target=self._run, name=f"robot {robot.address}", daemon=True
        )
        with contextlib.ExitStack() as opened:
            opened.callback(self.close)  # Leave no thread behind, after Ctrl-C too.
            self._thread.start()
            self.welcome = self.answer(Welcome, timeout_s=threading.TIMEOUT_MAX)
            opened.pop_all()

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
    ) -> Self:
        """Connect to a robot.

        Args:
            robot: A known robot, from `shapechanger.robot.client.known_robots.recall`; or an
                address, HOST or HOST:PORT.
            key: The robot's key, for an address.
            fingerprint: SHA-256 of its certificate, for an address; "insecure" for no encryption.
            role: Whether a person or a program drives.
            name: Display name of the client; user and host by default.
            pace: "realtime"; or "lockstep": the robot waits for each command of the client.
            frames: Whether observations contain frames.
            timeout_s: Time limit of the handshake, and of silence before the link is lost, s.

        Raises:
            RobotRefused: If the robot's certificate differs, or it refuses the client.
            LinkError: If no robot answers, or its version of the link differs. Without a
                fingerprint, the message shows the robot's fingerprint.
        """
        if not timeout_s > 0.0:
            raise LinkError(f"timeout_s must be above 0, got {timeout_s:g}.")
        if not isinstance(robot, KnownRobot):
            if not fingerprint:
                raise untrusted(parse_address(robot), timeout_s)
            robot = KnownRobot("robot", robot, key, fingerprint)
        own_name = f"user@{socket.gethostname()}"
        with contextlib.suppress(KeyError, OSError):  # A container may have no user name.
            own_name = f"{getpass.getuser()}@{socket.gethostname()}"
        hello = Hello(
            version=messages.VERSION,
            proof=b"",
            name=name or own_name[:64],
            role=role,
            pace=pace,
            frames=frames,
        )
        return cls(robot, hello, timeout_s)

    @property
    def alive(self) -> bool:
        """True while the link is up, in the process that made it."""
        return self.failure is None and self._process == os.getpid()

    def take(self) -> None:
        """Take control.

        Raises:
            RobotRefused: If the robot gives no control, for example if another client keeps it.
        """
        lease = self._ask(messages.Take(), messages.Lease)
        if not lease.mine:
            raise RobotRefused(lease.reason or f"{lease.holder or 'Another client'} has control.")

    def arm(self) -> None:
        """Let the outputs move; a person's client also ends an emergency stop that it has seen.

        Raises:
            RobotRefused: If the robot refuses, or is not armed in time.
        """
        seen = self.newest or self.ask()
        # Answer a new observation, but end only an emergency stop that was seen before the call.
        newest = self.ask()
        until_s = time.monotonic() + self._settings[2]
        heard = self.heard
        self._post(messages.Arm(answers=newest.message.seq, emergency=seen.message.emergencies))
        while time.monotonic() < until_s:
            newest = self.ask()
            if refused := self.said(messages.Refused, heard):
                raise RobotRefused(refused.reason)
            if newest.message.armed:
                return
        reason = newest.message.stop_reason
        raise RobotRefused(f"The robot did not arm{f': {reason}' if reason else ''}.")

    def command(self, values: Sequence[float], *, answers: int, scale: float = 1.0) -> int:
        """Send a command, in force until the next one or until the robot's deadline.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            answers: `seq` of the observation that the command answers.
            scale: Factor of the values, 0 to 1, by which the client limits its commands.

        Returns:
            The number of the command.
        """
        seq = next(self._numbers)
        floats, ttl_ms = tuple(map(float, values)), self.welcome.deadline_ms
        self._post(
            messages.Command(seq=seq, answers=answers, values=floats, ttl_ms=ttl_ms, scale=scale)
        )
        return seq

    def suggest(self, values: Sequence[float], *, answers: int) -> int:
        """Send a suggestion, which the robot only shows; refused if this client has control.

        A suggestion expires at the robot's deadline, and also requests the next observation.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            answers: `seq` of the observation that the suggestion answers.

        Returns:
            The number of the suggestion, for `refusal`.
        """
        seq = next(self._numbers)
        self._post(messages.Suggest(seq=seq, answers=answers, values=tuple(map(float, values))))
        return seq

    def acknowledge(self) -> None:
        """Ask for the next observation without a command."""
        self._post(messages.Acknowledge(seq=self.seq))

    def ask(self) -> Received:
        """Ask for a new observation, and wait for it."""
        seq = self.seq
        self.acknowledge()
        return self.observation(seq)

    def exchange(self, values: Sequence[float], seen: Received) -> Received:
        """Send a command, and wait for the next observation.

        Args:
            values: One number for each action of the robot, in the order of its action layout.
            seen: The observation that the command answers.
        """
        self.command(values, answers=seen.message.seq)
        return self.observation(seen.message.seq)

    def emergency_stop(self, reason: str = "") -> None:
        """Stop all outputs until a person arms the robot again; this needs no control."""
        self._post(messages.EmergencyStop(reason=reason))

    def disarm(self) -> None:
        """Disarm the robot, as a person or with control; until it is armed, its outputs rest."""
        self._post(messages.Disarm())

    def release(self) -> None:
        """Give control back, if this client has it; the robot stops and disarms."""
        self._post(messages.Release())

    def record(self, on: bool = True, name: str = "") -> messages.RecorderState:
        """Begin or end an episode on the robot's disk; only as a person.

        Args:
            on: Whether to record.
            name: Title of the episode; may be empty.

        Raises:
            RobotRefused: If the robot cannot record, for example on a full disk, records already,
                or has no episode to end.
        """
        return self._ask(
            messages.Record(on=on, name=name),
            messages.RecorderState,
            lambda state: state.recording == on and bool(state.episode),
        )

    def mark(self, text: str = "") -> messages.RecorderState:
        """Mark the newest step of the episode being recorded; raises `RobotRefused` without one."""
        before = self.recorder.marks if self.recorder else 0
        return self._ask(
            messages.Mark(text=text), messages.RecorderState, lambda state: state.marks > before
        )

    def undo(self, seconds: float = 5.0) -> messages.RecorderState:
        """Drop the newest steps of the episode being recorded; raises `RobotRefused` without any.

        Args:
            seconds: Duration of the steps to drop, s, above 0.
        """
        before = self.recorder.dropped if self.recorder else 0
        undo = messages.Undo(seconds=seconds)
        return self._ask(undo, messages.RecorderState, lambda state: state.dropped > before)

    def browse(self, before: str = "") -> messages.Recordings:
        """List up to `MAX_EPISODES` episodes on the robot, newest first; see `Recordings.more`.

        Args:
            before: Only episodes whose id sorts before this one; "" for the newest.

        Raises:
            RobotRefused: If the robot has no folder for recordings.
        """
        return self._ask(messages.Browse(before=before), messages.Recordings)

    def fetch(self, episode: str, first: int = 0, count: int = 1_000) -> messages.Piece:
        """Read a part of an episode on the robot's disk; raises `RobotRefused` if that fails.

        Args:
            episode: Id of the episode.
            first: Number of the first line, from 0.
            count: Number of lines; fewer are sent if the message would be too large.
        """
        request = messages.Fetch(episode=episode, first=first, count=count)
        return self._ask(request, messages.Piece)

    def ping(self) -> tuple[float, int]:
        """Measure the round trip.

        Returns:
            The duration of the round trip, s, and the robot's time at its answer, ns.
        """
        start = time.monotonic()
        pong = self._ask(messages.Ping(), messages.Pong)
        return time.monotonic() - start, pong.now_ns

    def close(self) -> None:
        """End the connection after pending messages are sent; may be called again."""
        if self._process != os.getpid():
            return  # A copy made by fork: the connection belongs to the other process.
        self.fail(LinkError("The connection was closed: make a new one."))
        self._call(self._stop.set)
        self._thread.join()

    def abandon(self) -> None:
        """Release and close without waiting or taking a lock.

        For clients that are dropped without `close`: the garbage collector may call this in any
        thread, including the connection's.
        """
        if self._process == os.getpid():
            self._call(self._enqueue, messages.Release())
            self._call(self._stop.set)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # The methods from here on run in the callers' threads.

    def _call(self, function: Callable[..., object], *arguments: object) -> None:
        """Call a function in the connection's thread, unless the thread has ended."""
        if self._loop is None:  # The thread has not begun.
            function(*arguments)
            return
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function, *arguments)

    def _post(self, message: ClientMessage) -> None:
        self.check()
        self._call(self._enqueue, message)

    def _ask(
        self,
        message: ClientMessage,
        kind: type[_Answer],
        accepts: Callable[[_Answer], bool] = lambda _: True,
    ) -> _Answer:
        """Send a request, and wait for its answer; all but `Take` and `Ping` wait their turn."""
        # A field out of range is an error before anything is sent.
        messages.decode_client_message(messages.encode(message))
        is_prompt = kind in (messages.Lease, messages.Pong)
        with contextlib.nullcontext() if is_prompt else self._asking:
            heard = self.heard
            self._post(message)
            return self.answer(kind, heard, accepts, None if is_prompt else _DISK_S)

    # The methods from here on run in the connection's thread.

    def _enqueue(self, message: ClientMessage) -> None:
        """Queue a message, replacing a waiting message of the same type.

        So after a blocked connection, the robot gets only the newest command.
        """
        self._pending = [m for m in self._pending if type(m) is not type(message)]
        self._pending.append(message)
        self._posted.set()

    def _run(self) -> None:
        try:
            asyncio.run(self._exchange())
        except LinkError as error:
            self.fail(error)
        except BaseException as error:
            self.fail(LinkError(f"The link to the robot failed: {error!r}."))
            raise
        finally:
            # Waiting callers must not block indefinitely.
            self.fail(LinkError("The connection was closed: make a new one."))

    async def _exchange(self) -> None:
        self._loop = asyncio.get_running_loop()
        async with connection.open_connection(*self._settings) as (websocket, welcome):
            self.put(welcome)
            self._heard_at = self._loop.time()
            links = (self._receive(websocket), self._send(websocket), self._watch())
            tasks = [asyncio.ensure_future(each) for each in (*links, self._stop.wait())]
            done, others = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in others:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            for task in done:
                task.result()
            # If this fails, the robot detects the end of the connection anyway.
            with contextlib.suppress(LinkError, TimeoutError):
                async with asyncio.timeout(connection.CLOSE_S):
                    await self._send_pending(websocket)
                    await websocket.close()

    async def _receive(self, websocket: aiohttp.ClientWebSocketResponse) -> None:
        while True:
            message = await connection.receive(websocket)
            self._heard_at = asyncio.get_running_loop().time()
            self.put(message)

    async def _watch(self) -> None:
        """Ping a silent robot; at the limit, end the connection, which a dead radio leaves open."""
        loop, limit_s = asyncio.get_running_loop(), self._settings[2]
        while (silent_s := loop.time() - self._heard_at) <= limit_s:
            if silent_s > _PING_AFTER * limit_s:
                self._enqueue(messages.Ping())
            await asyncio.sleep(_CHECK_EVERY * limit_s)
        raise connection.lost(f"no message for {silent_s:.1f} s")

    async def _send(self, websocket: aiohttp.ClientWebSocketResponse) -> None:
        while True:
            await self._posted.wait()
            self._posted.clear()
            await self._send_pending(websocket)

    async def _send_pending(self, websocket: aiohttp.ClientWebSocketResponse) -> None:
        while self._pending:
            message = self._pending.pop(0)
            with translate_errors(
                ConnectionError,
                aiohttp.ClientError,
                to=lambda error: connection.lost(str(error) or "the connection broke"),
            ):
                await websocket.send_bytes(messages.encode(message))
