"""Connection to a robot: the WebSocket, and its messages on their way to the calling threads."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections import deque
from collections.abc import AsyncGenerator, Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from shapechanger.errors import LinkError, MissingExtra, RobotRefused, StaleObservation
from shapechanger.robot.link import messages
from shapechanger.robot.link.address import Address
from shapechanger.robot.link.authentication import fingerprint_hex, make_proof
from shapechanger.robot.link.messages import (
    Challenge,
    ClientMessage,
    Event,
    Hello,
    Observation,
    Ping,
    PolicyState,
    RecorderState,
    Refused,
    RobotMessage,
    Welcome,
)

try:
    import aiohttp
except ImportError as error:
    raise MissingExtra("aiohttp", "remote") from error

PATH: Final = "/link"
"""Path of the WebSocket on the robot's server."""

_CLOSE_S: Final = 0.5  # Time limit of the closing handshake.
# Shares of the silence timeout: when to send a ping, and how often to check.
_PING_AFTER: Final = 0.4
_CHECK_EVERY: Final = 0.1

# attrs makes aiohttp's class in a way that pyright does not understand.
_CLOSING: Final = aiohttp.ClientWSTimeout(ws_close=_CLOSE_S)  # pyright: ignore[reportCallIssue]

_Handler = Callable[[RobotMessage], None]
_M = TypeVar("_M", Challenge, Welcome)


@dataclass(frozen=True, slots=True)
class Access:
    """Settings of a connection.

    Attributes:
        address: Address of the robot.
        key: The robot's key.
        fingerprint: SHA-256 of its certificate; None for no encryption.
        name: Display name of the client.
        role: Whether a person or a program drives.
        pace: Whether the clocks or the client set the pace.
        frames: Whether observations carry frames.
        timeout_s: Time limit of the handshake, and of silence, s.
    """

    address: Address
    key: bytes
    fingerprint: bytes | None
    name: str
    role: messages.Role
    pace: messages.Pace
    frames: bool
    timeout_s: float


class RobotConnection:
    """Open connection to a robot, made by `open_connection`.

    Attributes:
        welcome: Description of the robot.
    """

    def __init__(
        self, websocket: aiohttp.ClientWebSocketResponse, welcome: Welcome, access: Access
    ) -> None:
        self.welcome = welcome
        self._websocket = websocket
        self._access = access
        self._received_at = asyncio.get_running_loop().time()
        self._pending: list[ClientMessage] = []
        self._posted = asyncio.Event()

    def post(self, message: ClientMessage) -> None:
        """Queue a message, replacing a waiting message of the same type.

        After a blocked connection the robot so gets the newest command, and no older ones.
        """
        self._pending = [m for m in self._pending if type(m) is not type(message)]
        self._pending.append(message)
        self._posted.set()

    async def run(self, handle: _Handler, stop: asyncio.Event) -> None:
        """Receive and send until `stop` is set."""
        work = (self._receive(handle), self._send(), self._watch(), stop.wait())
        tasks = [asyncio.ensure_future(each) for each in work]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        for task in done:
            task.result()
        # Should this fail, the robot notices the end of the connection anyway.
        with contextlib.suppress(LinkError, TimeoutError):
            async with asyncio.timeout(_CLOSE_S):
                await self._send_pending()
                await self._websocket.close()

    async def _receive(self, handle: _Handler) -> None:
        loop = asyncio.get_running_loop()
        while True:
            message = await _receive(self._websocket)
            self._received_at = loop.time()
            handle(message)

    async def _send(self) -> None:
        while True:
            await self._posted.wait()
            self._posted.clear()
            await self._send_pending()

    async def _send_pending(self) -> None:
        while self._pending:
            message = self._pending.pop(0)
            try:
                await self._websocket.send_bytes(messages.encode(message))
            except (ConnectionError, aiohttp.ClientError) as error:
                raise _lost(str(error) or "the connection broke") from None

    async def _watch(self) -> None:
        """End a silent connection: a radio that dies closes nothing."""
        loop, limit_s = asyncio.get_running_loop(), self._access.timeout_s
        while True:
            await asyncio.sleep(_CHECK_EVERY * limit_s)
            silent_s = loop.time() - self._received_at
            if silent_s > limit_s:
                raise _lost(f"no message for {silent_s:.1f} s")
            if silent_s > _PING_AFTER * limit_s:
                self.post(Ping())


@asynccontextmanager
async def open_connection(access: Access) -> AsyncGenerator[RobotConnection]:
    """Connect and authenticate; raise `LinkError` or `RobotRefused`."""
    expected = access.fingerprint
    websocket: aiohttp.ClientWebSocketResponse | None = None
    sockets: list[socket.socket] = []

    def made(address: tuple[Any, ...]) -> socket.socket:
        sockets.append(socket.socket(*address[:3]))
        return sockets[-1]

    connector = aiohttp.TCPConnector(
        ssl=aiohttp.Fingerprint(expected) if expected else True, socket_factory=made
    )
    session = aiohttp.ClientSession(connector=connector, connector_owner=False)
    try:
        async with asyncio.timeout(access.timeout_s) as limit:
            websocket = await session.ws_connect(
                f"{'wss' if expected else 'ws'}://{access.address}{PATH}",
                max_msg_size=messages.MAX_ROBOT_MESSAGE,
                timeout=_CLOSING,
            )
            welcome = await _welcomed(websocket, access)
            limit.reschedule(None)
            yield RobotConnection(websocket, welcome, access)
    # Callers see one error of ours, without a chain of library errors.
    except TimeoutError:
        raise LinkError(
            f"The robot at {access.address} did not answer within {access.timeout_s:.1f} s. Is it "
            "on, and in this network?"
        ) from None
    except aiohttp.ServerFingerprintMismatch as error:
        raise RobotRefused(
            f"{access.address} shows the fingerprint\n  {fingerprint_hex(error.got)}\nand not\n"
            f"  {fingerprint_hex(error.expected)}\nEither the robot was set up again, or the "
            "connection is intercepted. Compare it with the one that `shapechanger robot key NAME` "
            "shows on the robot before you trust it."
        ) from None
    except aiohttp.WSServerHandshakeError as error:
        raise LinkError(
            f"The server at {access.address} is not a robot of this kind: {error.message}."
        ) from None
    except (aiohttp.ClientError, OSError) as error:
        if isinstance(error, LinkError):
            raise
        raise LinkError(
            f"No robot answers at {access.address} ({error}). Is it on, and does "
            "`shapechanger robot serve` run on it?"
        ) from None
    finally:
        # Skip the closing handshake of TLS, which a dead connection never answers.
        for each in sockets:
            with contextlib.suppress(OSError):  # It was never connected, or has ended already.
                each.shutdown(socket.SHUT_RDWR)
        if websocket is not None:
            await websocket.close()
        await session.close()
        await connector.close(abort_ssl=True)
        # Wait until the loop has noticed the end of the sockets, which would stay open otherwise.
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_CLOSE_S):
                while any(each.fileno() != -1 for each in sockets):
                    await asyncio.sleep(0)


async def _welcomed(websocket: aiohttp.ClientWebSocketResponse, access: Access) -> Welcome:
    challenge = await _expect(websocket, Challenge)
    if challenge.version != messages.VERSION:
        older = "robot" if challenge.version < messages.VERSION else "workstation"
        raise LinkError(
            f"The robot uses version {challenge.version} of the link, this workstation "
            f"{messages.VERSION}: update Shapechanger on the {older}."
        )
    hello = Hello(
        version=messages.VERSION,
        proof=make_proof(access.key, challenge.nonce, access.fingerprint or b"", access.role),
        name=access.name,
        role=access.role,
        pace=access.pace,
        frames=access.frames,
    )
    await websocket.send_bytes(messages.encode(hello))
    return await _expect(websocket, Welcome)


async def _expect(websocket: aiohttp.ClientWebSocketResponse, kind: type[_M]) -> _M:
    """Receive a message of one type."""
    message = await _receive(websocket)
    if isinstance(message, messages.Refused):
        raise RobotRefused(message.reason)
    if not isinstance(message, kind):
        raise LinkError(f"Expected a {kind.__name__} from the robot, got {type(message).__name__}.")
    return message


async def _receive(websocket: aiohttp.ClientWebSocketResponse) -> RobotMessage:
    """Receive the next message."""
    received = await websocket.receive()
    if received.type is aiohttp.WSMsgType.BINARY:
        return messages.decode_robot_message(received.data)
    if received.type is aiohttp.WSMsgType.TEXT:
        raise LinkError("Expected a binary message from the robot, got text.")
    if received.type is aiohttp.WSMsgType.ERROR:
        raise _lost(str(received.data) or "the connection broke")
    raise _lost(str(received.extra or "") or "the robot closed it")


def _lost(why: str) -> LinkError:
    return LinkError(f"The link to the robot is lost: {why}.")


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
