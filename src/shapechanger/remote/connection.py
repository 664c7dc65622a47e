"""One connection to a robot: the WebSocket, its handshake, and the watch over its silence."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Final

from shapechanger.errors import LinkError, MissingExtra, RobotRefused
from shapechanger.link import messages
from shapechanger.link.address import Address
from shapechanger.link.authentication import fingerprint_hex, make_proof
from shapechanger.link.messages import Challenge, ClientMessage, Hello, Ping, RobotMessage, Welcome

try:
    import aiohttp
except ImportError as error:
    raise MissingExtra("aiohttp", "remote") from error

__all__ = ["PATH", "Access", "RobotConnection", "open_connection"]

PATH: Final = "/link"
"""Where on the robot's server the WebSocket is."""

# s. A robot that answers needs a round trip; one that does not is not waited for.
_GOODBYE_S: Final = 0.5
# Of the time after which a silent link is lost: when to ask whether anybody is there, and how often
# to look.
_ASK_AFTER: Final = 0.4
_LOOK_EVERY: Final = 0.1

# aiohttp's class is made by attrs in a way that pyright does not see through.
_CLOSING: Final = aiohttp.ClientWSTimeout(ws_close=_GOODBYE_S)  # pyright: ignore[reportCallIssue]

_Handler = Callable[[RobotMessage], None]


@dataclass(frozen=True, slots=True)
class Access:
    """Who connects to what, and how.

    Attributes:
        address: Where the robot is.
        key: The robot's key.
        fingerprint: SHA-256 of its certificate; None for no encryption.
        name: Who connects, for people to read.
        role: Who drives.
        pace: Who keeps the time.
        frames: Whether observations shall carry pictures.
        timeout_s: How long the handshake may take, and silence last.
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
    """A robot that has said welcome; made by `open_connection`.

    Attributes:
        welcome: What the robot is.
    """

    def __init__(
        self, line: aiohttp.ClientWebSocketResponse, welcome: Welcome, access: Access
    ) -> None:
        self.welcome = welcome
        self._line = line
        self._access = access
        self._heard_at = asyncio.get_running_loop().time()
        self._pending: list[ClientMessage] = []
        self._something = asyncio.Event()

    def post(self, message: ClientMessage) -> None:
        """Send when the line is free; one of the same kind that still waits is replaced.

        So a line that was stuck brings one command, the newest, and never the ones before.
        """
        self._pending = [m for m in self._pending if type(m) is not type(message)]
        self._pending.append(message)
        self._something.set()

    async def run(self, handle: _Handler, stop: asyncio.Event) -> None:
        """Receive and send until told to stop.

        Args:
            handle: What to do with each message; it may raise `LinkError` to end the link.
            stop: When set, what is pending is sent, and the link closed.

        Raises:
            LinkError: If the link is lost, or the robot talks nonsense.
        """
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
        await self._say_goodbye()

    async def _receive(self, handle: _Handler) -> None:
        loop = asyncio.get_running_loop()
        while True:
            message = await _heard(self._line)
            self._heard_at = loop.time()
            handle(message)

    async def _send(self) -> None:
        while True:
            await self._something.wait()
            self._something.clear()
            await self._send_pending()

    async def _send_pending(self) -> None:
        while self._pending:
            message = self._pending.pop(0)
            try:
                await self._line.send_bytes(messages.encode(message))
            except (ConnectionError, aiohttp.ClientError) as error:
                raise _lost(str(error) or "the line broke") from None

    async def _watch(self) -> None:
        """End a link that is silent: a radio that dies says no goodbye."""
        loop, limit_s = asyncio.get_running_loop(), self._access.timeout_s
        while True:
            await asyncio.sleep(_LOOK_EVERY * limit_s)
            silent_s = loop.time() - self._heard_at
            if silent_s > limit_s:
                raise _lost(f"nothing was heard for {silent_s:.1f} s")
            if silent_s > _ASK_AFTER * limit_s:
                self.post(Ping())

    async def _say_goodbye(self) -> None:
        try:
            async with asyncio.timeout(_GOODBYE_S):
                await self._send_pending()
                await self._line.close()
        except (LinkError, TimeoutError):
            return  # Whoever leaves need not be heard; the robot notices the end of the line.


@asynccontextmanager
async def open_connection(access: Access) -> AsyncGenerator[RobotConnection]:
    """Connect, prove that we hold the key, and be welcomed.

    Raises:
        RobotRefused: If the robot is another one than expected, or does not want us.
        LinkError: If nobody answers, or nobody who speaks as we do.
    """
    expected = access.fingerprint
    line: aiohttp.ClientWebSocketResponse | None = None
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
            line = await session.ws_connect(
                f"{'wss' if expected else 'ws'}://{access.address}{PATH}",
                max_msg_size=messages.MAX_ROBOT_MESSAGE,
                timeout=_CLOSING,
            )
            welcome = await _welcomed(line, access)
            limit.reschedule(None)
            yield RobotConnection(line, welcome, access)
    # What went wrong below is in our words: a program sees one error, and no chain of them.
    except TimeoutError:
        raise LinkError(
            f"The robot at {access.address} did not answer within {access.timeout_s:.1f} s: is it "
            "on, and in this network?"
        ) from None
    except aiohttp.ServerFingerprintMismatch as error:
        raise RobotRefused(
            f"{access.address} shows the fingerprint\n  {fingerprint_hex(error.got)}\nand not\n"
            f"  {fingerprint_hex(error.expected)}\nEither the robot was set up anew, or somebody "
            "stands in between. Compare it with the one that `shapechanger robot key NAME` shows "
            "on the robot before you trust it."
        ) from None
    except aiohttp.WSServerHandshakeError as error:
        raise LinkError(
            f"What answers at {access.address} is no robot of this kind: {error.message}."
        ) from None
    except (aiohttp.ClientError, OSError) as error:
        if isinstance(error, LinkError):
            raise
        raise LinkError(
            f"No robot answers at {access.address} ({error}): is it on, and does "
            "`shapechanger robot serve` run on it?"
        ) from None
    finally:
        # Without the farewell of TLS, which a dead line never answers.
        for each in sockets:
            with contextlib.suppress(OSError):  # It was never connected, or has ended already.
                each.shutdown(socket.SHUT_RDWR)
        if line is not None:
            await line.close()
        await session.close()
        await connector.close(abort_ssl=True)
        await _let_go(sockets)


async def _let_go(sockets: list[socket.socket]) -> None:
    """Wait until the loop has noticed that the sockets ended; they would stay open otherwise."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(_GOODBYE_S):
            while any(each.fileno() != -1 for each in sockets):
                await asyncio.sleep(0)


async def _welcomed(line: aiohttp.ClientWebSocketResponse, access: Access) -> Welcome:
    challenge = await _heard(line)
    if isinstance(challenge, messages.Refused):
        raise RobotRefused(challenge.reason)
    if not isinstance(challenge, Challenge):
        raise LinkError(f"The robot began with {type(challenge).__name__}, not with a challenge.")
    if challenge.version != messages.VERSION:
        older = "robot" if challenge.version < messages.VERSION else "workstation"
        raise LinkError(
            f"The robot speaks version {challenge.version}, this workstation {messages.VERSION}: "
            f"update Shapechanger on the {older}."
        )
    hello = Hello(
        version=messages.VERSION,
        proof=make_proof(access.key, challenge.nonce, access.fingerprint or b"", access.role),
        name=access.name,
        role=access.role,
        pace=access.pace,
        frames=access.frames,
    )
    await line.send_bytes(messages.encode(hello))
    answer = await _heard(line)
    if isinstance(answer, messages.Refused):
        raise RobotRefused(answer.reason)
    if not isinstance(answer, Welcome):
        raise LinkError(f"The robot answered with {type(answer).__name__}, not with a welcome.")
    return answer


async def _heard(line: aiohttp.ClientWebSocketResponse) -> RobotMessage:
    """The next message.

    Raises:
        LinkError: If there is none, or it is none.
    """
    heard = await line.receive()
    if heard.type is aiohttp.WSMsgType.BINARY:
        return messages.decode_robot_message(heard.data)
    if heard.type is aiohttp.WSMsgType.TEXT:
        raise LinkError("The robot sent text where a message should be.")
    if heard.type is aiohttp.WSMsgType.ERROR:
        raise _lost(str(heard.data) or "the line broke")
    raise _lost(str(heard.extra or "") or "the robot closed it")


def _lost(why: str) -> LinkError:
    return LinkError(f"The link to the robot is lost: {why}.")
