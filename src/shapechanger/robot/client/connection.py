"""Connection to a robot: the WebSocket, and the inbox from which callers read its messages."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import threading
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import msgspec

from shapechanger.errors import (
    LinkError,
    MissingExtra,
    RobotRefused,
    StaleObservation,
    translate_errors,
)
from shapechanger.robot.client.known_robots import KnownRobot, parse_trust
from shapechanger.robot.link import messages
from shapechanger.robot.link.address import parse_address
from shapechanger.robot.link.authentication import make_proof, parse_key

with translate_errors(ImportError, to=lambda _: MissingExtra("aiohttp", "remote")):
    import aiohttp

CLOSE_S: Final = 0.5
"""Time limit of the closing handshake, s."""

# attrs makes aiohttp's class in a way that pyright does not understand.
_CLOSING: Final = aiohttp.ClientWSTimeout(ws_close=CLOSE_S)  # pyright: ignore[reportCallIssue]

_M = TypeVar("_M", bound=messages.RobotMessage)
_T = TypeVar("_T")


@asynccontextmanager
async def open_connection(
    robot: KnownRobot, hello: messages.Hello, timeout_s: float
) -> AsyncGenerator[tuple[aiohttp.ClientWebSocketResponse, messages.Welcome]]:
    """Connect and authenticate within a time limit; the proof is added to `hello`."""
    address, expected = parse_address(robot.address), parse_trust(robot.fingerprint)
    sockets: list[socket.socket] = []

    def made(address: tuple[Any, ...]) -> socket.socket:
        sockets.append(socket.socket(*address[:3]))
        return sockets[-1]

    connector = aiohttp.TCPConnector(
        ssl=aiohttp.Fingerprint(expected) if expected else True, socket_factory=made
    )
    session = aiohttp.ClientSession(connector=connector, connector_owner=False)
    websocket: aiohttp.ClientWebSocketResponse | None = None
    try:
        async with asyncio.timeout(timeout_s) as limit:
            websocket = await session.ws_connect(
                f"{'wss' if expected else 'ws'}://{address}/link",
                max_msg_size=messages.MAX_ROBOT_MESSAGE,
                timeout=_CLOSING,
            )
            challenge = await _expect(websocket, messages.Challenge)
            if challenge.version != messages.VERSION:
                older = "robot" if challenge.version < messages.VERSION else "workstation"
                raise LinkError(
                    f"The robot uses version {challenge.version} of the link, this workstation "
                    f"{messages.VERSION}: update Shapechanger on the {older}."
                )
            key = parse_key(robot.key) if robot.key else b""
            proof = make_proof(key, challenge.nonce, expected or b"", hello.role)
            answer = msgspec.structs.replace(hello, proof=proof)
            await websocket.send_bytes(messages.encode(answer))
            welcome = await _expect(websocket, messages.Welcome)
            limit.reschedule(None)
            yield websocket, welcome
    except LinkError:
        raise
    except aiohttp.ServerFingerprintMismatch as error:
        raise RobotRefused(
            f"{address} shows the fingerprint\n  {error.got.hex()}\nand not\n"
            f"  {error.expected.hex()}\nEither the robot was set up again, or the connection is "
            "intercepted. Compare it with the one that `shapechanger robot key NAME` shows on the "
            "robot before you trust it."
        ) from None
    except (aiohttp.ClientError, OSError) as error:  # TimeoutError is an OSError.
        # Callers see one error of ours, without a chain of library errors.
        raise LinkError(
            f"No robot answers at {address} within {timeout_s:.1f} s ({error!r}). Is it on, in "
            "this network, and does `shapechanger robot serve` run on it?"
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
        # Wait until the loop has closed the sockets.
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_S):
                while any(each.fileno() != -1 for each in sockets):
                    await asyncio.sleep(0)


async def receive(websocket: aiohttp.ClientWebSocketResponse) -> messages.RobotMessage:
    """Receive the next message."""
    received = await websocket.receive()
    match received.type:
        case aiohttp.WSMsgType.BINARY:
            return messages.decode_robot_message(received.data)
        case aiohttp.WSMsgType.TEXT:
            raise LinkError("Expected a binary message from the robot, got text.")
        case _:
            raise lost(str(received.extra or received.data or "the robot closed it"))


def lost(why: str) -> LinkError:
    """Return the error for a lost link."""
    return LinkError(f"The link to the robot is lost: {why}.")


async def _expect(websocket: aiohttp.ClientWebSocketResponse, kind: type[_M]) -> _M:
    message = await receive(websocket)
    if isinstance(message, messages.Refused):
        raise RobotRefused(message.reason)
    if not isinstance(message, kind):
        raise LinkError(f"Expected a {kind.__name__} from the robot, got {type(message).__name__}.")
    return message


@dataclass(frozen=True, slots=True)
class Received:
    """An observation and its time of arrival."""

    message: messages.Observation
    received_at: float  # Time of arrival on this machine's monotonic clock, s.
    jpeg: bytes | None  # Frame `message.frame_seq`, from this or an earlier message, if any.


class Inbox:
    """Messages of a robot, for any number of calling threads.

    The newest observation is in one slot, so that a slow reader never gets an old one. A robot
    sends each frame once; later observations of the same frame take it over from the one before.
    """

    def __init__(self, clock: Callable[[], float], patience_s: float) -> None:
        self.newest: Received | None = None  # The newest observation of any age.
        self.heard = 0  # Number of messages so far.
        self.failure: LinkError | None = None  # Why the link is lost; None while it is up.
        self._clock = clock
        self._patience_s = patience_s  # Default time limit of a wait, s.
        self._process = os.getpid()
        self._changed = threading.Condition()
        self._events: deque[messages.Event] = deque(maxlen=256)
        self._refusals: dict[int, str] = {}
        self._said: dict[type[messages.RobotMessage], tuple[int, messages.RobotMessage]] = {}

    @property
    def seq(self) -> int:
        """Number of the newest observation; 0 before the first."""
        return self.newest.message.seq if self.newest else 0

    @property
    def recorder(self) -> messages.RecorderState | None:
        """Last reported state of the robot's recorder; None before the first report."""
        return self.said(messages.RecorderState)

    def put(self, message: messages.RobotMessage) -> None:
        """Store a message that has just arrived."""
        with self._changed:
            self.heard += 1
            match message:
                case messages.Observation():
                    if message.seq <= self.seq:
                        raise LinkError(
                            f"Observation {message.seq} arrived after {self.seq}: a replay."
                        )
                    last, jpeg = self.newest, message.frame
                    if jpeg is None and last and message.frame_seq == last.message.frame_seq:
                        jpeg = last.jpeg
                    self.newest = Received(message, self._clock(), jpeg)
                case messages.Event():
                    self._events.append(message)
                case messages.Refused(fatal=True):
                    raise RobotRefused(message.reason)
                case messages.Refused(seq=int(seq)):
                    self._refusals = {seq: message.reason}
                case _:
                    self._said[type(message)] = self.heard, message
            self._changed.notify_all()

    def fail(self, failure: LinkError) -> None:
        """End all waits with an error; only the first error is kept."""
        with self._changed:
            self.failure = self.failure or failure
            self._changed.notify_all()

    def check(self) -> None:
        """Raise an error if the link is lost, or belongs to another process."""
        if self._process != os.getpid():
            raise LinkError("This connection belongs to another process: make one in this one.")
        if self.failure is not None:
            raise type(self.failure)(*self.failure.args)

    def wait(self, find: Callable[[], _T | None], timeout_s: float | None = None) -> _T | None:
        """Wait until `find` returns a value. Return None after the time limit."""
        self.check()
        limit_s = self._patience_s if timeout_s is None else timeout_s
        with self._changed:
            self._changed.wait_for(lambda: self.failure or find(), limit_s)
            self.check()
            return find()

    def observation(self, newer_than: int = 0, timeout_s: float | None = None) -> Received:
        """Wait for an observation with a larger `seq` than `newer_than`, and return the newest one.

        Raises:
            StaleObservation: If none arrives in time.
        """
        limit_s = self._patience_s if timeout_s is None else timeout_s
        found = self.wait(lambda: self.newest if self.seq > newer_than else None, limit_s)
        if found is not None:
            return found
        last = self.newest
        age = f"the last is {self._clock() - last.received_at:.2f} s old" if last else "none ever"
        raise StaleObservation(f"The robot sent no new observation within {limit_s:.2f} s ({age}).")

    def said(self, kind: type[_M], since: int = 0) -> _M | None:
        """Return the last message of a kind, if it came after message number `since`."""
        number, message = self._said.get(kind, (0, None))
        return message if isinstance(message, kind) and number > since else None

    def answer(
        self,
        kind: type[_M],
        since: int = 0,
        accepts: Callable[[_M], bool] = lambda _: True,
        timeout_s: float | None = None,
    ) -> _M:
        """Wait for a message that answers a request, which was sent after message number `since`.

        With a `timeout_s`, s, a refusal is raised as `RobotRefused`. Without one, the default time
        limit applies, and refusals are ignored.
        """

        def find() -> _M | messages.Refused | None:
            said = self.said(kind, since)
            if said is not None and accepts(said):
                return said
            return None if timeout_s is None else self.said(messages.Refused, since)

        found = self.wait(find, timeout_s)
        if isinstance(found, messages.Refused):
            raise RobotRefused(found.reason)
        if found is None:
            raise LinkError(f"The robot did not answer with a {kind.__name__!r} in time.")
        return found

    def events(self) -> list[messages.Event]:
        """Return the events since the last call, oldest first; of more than 256, the newest."""
        with self._changed:
            events = list(self._events)
            self._events.clear()
        return events

    def refusal(self, seq: int) -> str:
        """Return why the robot refused message `seq`; "" if it did not, or refused one since."""
        return self._refusals.get(seq, "")
