"""The daemon's end of the socket to the guard: orders out, states in; it never blocks."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Final

from shapechanger.robot.guard.wire import MAX_DATAGRAM, GuardState, Order, decode_state, encode

__all__ = ["GuardPort"]

_log = logging.getLogger(__name__)

# Orders that must arrive whatever happens. One of each is enough: they say the same twice.
_URGENT: Final = ("end", "emergency", "disarm", "halt")


class GuardPort:
    """Hands orders to the guard and reads what it does.

    A guard that does not read fills the socket. Then a command is dropped, since it would be too
    old when the guard reads again, and a stop waits until there is room.

    Args:
        fd: Descriptor of the socket; this object owns it.
        on_state: Called with each state, in order.
        on_lost: Called once, when the guard is gone.
    """

    def __init__(
        self, fd: int, on_state: Callable[[GuardState], None], on_lost: Callable[[], None]
    ) -> None:
        self._socket = socket.socket(fileno=fd)
        self._socket.setblocking(False)
        self._on_state = on_state
        self._on_lost = on_lost
        self._lost = False
        self._stuck = False
        self._waiting: dict[str, Order] = {}
        self._loop: asyncio.AbstractEventLoop | None = None

    def attach(self, loop: asyncio.AbstractEventLoop) -> None:
        """Read states as they come from now on."""
        self._loop = loop
        loop.add_reader(self._socket, self.drain)

    def send(self, order: Order) -> None:
        """Hand over an order."""
        if self._lost:
            return
        if not self._waiting and self._try(order):
            self._stuck = False
            return
        if not self._stuck:
            self._stuck = True
            _log.warning("The guard does not read: commands are dropped, and stops wait.")
        if order.kind in _URGENT:
            self._waiting.setdefault(order.kind, order)
            if self._loop is not None:
                self._loop.add_writer(self._socket, self._send_waiting)

    def drain(self) -> None:
        """Read all states that have arrived."""
        while not self._lost:
            try:
                data = self._socket.recv(MAX_DATAGRAM)
            except BlockingIOError:
                return
            except ConnectionResetError:
                data = b""
            if not data:
                self._lose()
                return
            try:
                state = decode_state(data)
            except ValueError as error:
                _log.warning("The guard said something else than its state: %s", error)
                continue
            self._on_state(state)

    def close(self) -> None:
        """Close the socket, which tells the guard to stop."""
        self._lost = True  # Whatever is said from now on goes nowhere.
        if self._loop is not None and self._socket.fileno() >= 0:
            self._loop.remove_reader(self._socket)
            self._loop.remove_writer(self._socket)
        self._socket.close()

    def _try(self, order: Order) -> bool:
        try:
            self._socket.send(encode(order))
        except BlockingIOError:
            return False
        except (BrokenPipeError, ConnectionResetError):
            self._lose()
        return True

    def _send_waiting(self) -> None:
        for kind, order in list(self._waiting.items()):
            if not self._try(order):
                return
            self._waiting.pop(kind, None)
        if self._loop is not None and not self._lost:
            self._loop.remove_writer(self._socket)

    def _lose(self) -> None:
        if self._lost:
            return
        self._lost = True
        self._waiting.clear()
        if self._loop is not None:
            self._loop.remove_reader(self._socket)
            self._loop.remove_writer(self._socket)
        self._on_lost()
