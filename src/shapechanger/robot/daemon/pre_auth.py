"""The place before the door: sockets of which nobody knows yet who holds their other end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
import ssl
from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Final, Protocol

from shapechanger.errors import RobotError

__all__ = ["PRE_AUTH_TIMEOUT_S", "Listener", "PreAuthConnection", "PreAuthConnections"]

PRE_AUTH_TIMEOUT_S: Final = 3.0
"""Seconds in which a socket must ask for something, and after that for the next thing."""

_MOST: Final = 48
_MOST_OF_ONE: Final = 16  # A browser opens six, and somebody may have two pages open.


class PreAuthConnection(Protocol):
    """A socket that was accepted."""

    @property
    def address(self) -> str:
        """Where it comes from."""
        ...

    @property
    def is_gone(self) -> bool:
        """Whether it has closed by itself."""
        ...

    def drop(self) -> None:
        """End it, without a word."""
        ...


@dataclass(frozen=True, slots=True)
class _Waiting:
    visitor: PreAuthConnection
    timer: asyncio.TimerHandle


class PreAuthConnections:
    """Keeps strangers few and short, so that whoever holds the key always finds a place.

    Nobody is turned away for others' sake, since that one may be the person who wants to stop the
    robot: the newcomer gets the place of the oldest socket of the address that has the most.

    Args:
        most: How many may be here.
        most_of_one: How many of one address.
        patience_s: Seconds after which one that asked for nothing is dropped.
    """

    def __init__(
        self,
        most: int = _MOST,
        most_of_one: int = _MOST_OF_ONE,
        patience_s: float = PRE_AUTH_TIMEOUT_S,
    ) -> None:
        self._most = most
        self._most_of_one = most_of_one
        self._patience_s = patience_s
        self._waiting: dict[Hashable, _Waiting] = {}

    def __len__(self) -> int:
        """How many are here."""
        return len(self._waiting)

    def enter(self, key: Hashable, visitor: PreAuthConnection) -> None:
        """Let a socket wait; there is always room, at somebody's cost.

        Args:
            key: What it is known by from now on.
            visitor: The socket.
        """
        for other in [k for k, waiting in self._waiting.items() if waiting.visitor.is_gone]:
            self.leave(other)
        counts = Counter(waiting.visitor.address for waiting in self._waiting.values())
        if counts[visitor.address] >= self._most_of_one:
            self._drop_oldest(visitor.address)
        elif len(self._waiting) >= self._most:
            self.drop_one()
        timer = asyncio.get_running_loop().call_later(self._patience_s, self._drop, key)
        self._waiting[key] = _Waiting(visitor, timer)

    def renew(self, key: Hashable) -> None:
        """It was given a file of the console: it may wait anew, as the youngest."""
        waiting = self._waiting.pop(key, None)
        if waiting is None:
            return
        waiting.timer.cancel()
        timer = asyncio.get_running_loop().call_later(self._patience_s, self._drop, key)
        self._waiting[key] = _Waiting(waiting.visitor, timer)

    def keep(self, key: Hashable) -> None:
        """It asked for the link, which has a limit of its own for the hello."""
        if key in self._waiting:
            self._waiting[key].timer.cancel()

    def leave(self, key: Hashable) -> None:
        """It has shown the key, or it has ended."""
        waiting = self._waiting.pop(key, None)
        if waiting is not None:
            waiting.timer.cancel()

    def drop_one(self) -> None:
        """Make room: the oldest one of the address that has the most."""
        counts = Counter(waiting.visitor.address for waiting in self._waiting.values())
        if counts:
            # Of addresses that have as many, the first is the one that has been here longest.
            self._drop_oldest(max(counts, key=lambda address: counts[address]))

    def close(self) -> None:
        """Drop everybody."""
        for key in list(self._waiting):
            self._drop(key)

    def _drop_oldest(self, address: str) -> None:
        self._drop(next(k for k, w in self._waiting.items() if w.visitor.address == address))

    def _drop(self, key: Hashable) -> None:
        visitor = self._waiting[key].visitor
        self.leave(key)
        visitor.drop()


_log = logging.getLogger(__name__)

_BACKLOG: Final = 32
_SEND_BUFFER: Final = 32 * 1024  # Bytes that the kernel holds for one client: a few pictures.
_REST_S: Final = 0.05  # After an accept that failed, for want of descriptors most likely.


class Listener:
    """Accepts connections, and keeps those that are not known yet on the doorstep.

    Args:
        doorstep: Where they wait, by the protocol that speaks with them.
        protocol: Makes what speaks with a connection.
        tls: What to speak TLS with; None for no TLS.
    """

    def __init__(
        self,
        doorstep: PreAuthConnections,
        protocol: Callable[[], asyncio.Protocol],
        tls: ssl.SSLContext | None,
    ) -> None:
        self._doorstep = doorstep
        self._protocol = protocol
        self._tls = tls
        self._sockets: list[socket.socket] = []
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self, host: str, port: int) -> int:
        """Begin to listen.

        Returns:
            The port.

        Raises:
            RobotError: If the address cannot be listened at.
        """
        loop = asyncio.get_running_loop()
        try:
            found = await loop.getaddrinfo(
                host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
            )
            for family, *_, address in dict.fromkeys(found):
                self._sockets.append(_listening(family, address))
        except OSError as error:
            self._close_sockets()
            why = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
            raise RobotError(
                f"{host} port {port} cannot be listened at: {why}. Does the robot run already?"
            ) from error
        self._tasks = [asyncio.create_task(self._accept(each)) for each in self._sockets]
        return self._sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Stop, and drop those that are not known yet."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._close_sockets()
        self._doorstep.close()

    def _close_sockets(self) -> None:
        for each in self._sockets:
            each.close()

    async def _accept(self, listening: socket.socket) -> None:
        loop, fails = asyncio.get_running_loop(), False
        while True:
            try:
                accepted, address = await loop.sock_accept(listening)
            except OSError as error:
                if not fails:
                    _log.warning("Connections cannot be accepted: %s", error)
                fails = True
                self._doorstep.drop_one()
                await asyncio.sleep(_REST_S)
                continue
            fails = False
            protocol = self._protocol()
            self._doorstep.enter(protocol, _Arrival(accepted, address[0], protocol, self._tls))
            await asyncio.sleep(0)  # However many come, those who are here have their turn.


class _Arrival:
    """A connection from its acceptance on.

    Attributes:
        address: Where it comes from.
    """

    def __init__(
        self,
        accepted: socket.socket,
        address: str,
        protocol: asyncio.Protocol,
        tls: ssl.SSLContext | None,
    ) -> None:
        self.address = address
        self._socket = accepted
        self._transport: asyncio.Transport | None = None
        self._task = asyncio.create_task(self._connect(protocol, tls))

    @property
    def is_gone(self) -> bool:
        """Whether it has closed by itself."""
        return self._task.done() and (self._transport is None or self._transport.is_closing())

    def drop(self) -> None:
        """End it, without a word."""
        if self._transport is not None:
            self._transport.abort()
            return
        # The handshake reads the end of the connection, however far it has come.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    async def _connect(self, protocol: asyncio.Protocol, tls: ssl.SSLContext | None) -> None:
        loop = asyncio.get_running_loop()
        try:
            self._transport, _ = await loop.connect_accepted_socket(
                lambda: protocol, self._socket, ssl=tls
            )
        except OSError as error:  # Who speaks no TLS, or leaves, is nobody we talk to.
            _log.debug("%s does not get through the handshake: %s", self.address, error)


def _listening(family: int, address: tuple[object, ...]) -> socket.socket:
    listening = socket.socket(family, socket.SOCK_STREAM)
    try:
        listening.setblocking(False)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        if family == socket.AF_INET6:
            listening.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listening.bind(address)
        listening.listen(_BACKLOG)
    except BaseException:
        listening.close()
        raise
    return listening
