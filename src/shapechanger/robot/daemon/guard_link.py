"""The daemon's end of the socket to the guard: orders out, states in; it never blocks."""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import logging
import os
import select
import socket
import threading
from collections.abc import Callable
from typing import Final

from shapechanger.robot.guard.messages import MAX_DATAGRAM, GuardState, Order, decode_state, encode

__all__ = ["LIFELINE", "GuardLink", "send_heartbeats", "send_lifeline"]

_log = logging.getLogger(__name__)

# Orders that must arrive whatever happens. One of each is enough: they say the same twice.
_URGENT: Final = ("end", "emergency", "disarm", "halt")


class GuardLink:
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


LIFELINE: Final = b"life"
"""What comes with the descriptor."""

_CLONE_FILES: Final = 0x400  # linux/sched.h
_READY_S: Final = 1.0


def send_lifeline(guard_fd: int) -> bool:
    """Send the guard a descriptor that ends when this process does.

    To be called while few files are open and nothing else runs.

    Args:
        guard_fd: The socket to the guard.

    Returns:
        Whether that is possible here; if not, the guard waits for the end of the socket.
    """
    ours, theirs = os.pipe()
    # The new thread has a copy of each file; the one that nobody else shall have is closed here.
    apart = threading.Event()
    failed: list[bool] = []
    threading.Thread(
        target=_hold, args=(theirs, apart, failed), name="shapechanger-life", daemon=True
    ).start()
    held = apart.wait(_READY_S) and not failed
    os.close(theirs)
    if held:
        # A guard that is gone already is noticed by whoever reads the socket.
        with (
            socket.socket(fileno=os.dup(guard_fd)) as guard,
            contextlib.suppress(BrokenPipeError, ConnectionResetError),
        ):
            socket.send_fds(guard, [LIFELINE], [ours])
    os.close(ours)
    return held


def _hold(fd: int, apart: threading.Event, failed: list[bool]) -> None:
    """Hold a file that no other thread has, until the process ends or the other side does."""
    unshare = getattr(ctypes.CDLL(None), "unshare", None)  # There is none but on Linux.
    if unshare is None or unshare(_CLONE_FILES) != 0:
        failed.append(True)
        apart.set()
        return
    os.closerange(0, fd)
    os.closerange(fd + 1, os.sysconf("SC_OPEN_MAX"))
    ended = select.poll()
    ended.register(fd, 0)  # Only that nobody reads any more.
    apart.set()
    ended.poll()


async def send_heartbeats(fd: int, period_s: float) -> None:
    """Send a byte each period until the supervisor is gone.

    Args:
        fd: Socket to the supervisor; this function owns it.
        period_s: Real seconds between two bytes.
    """
    with socket.socket(fileno=fd) as heart:
        heart.setblocking(False)
        while True:
            try:
                # A supervisor that does not read has a full socket; that is no reason to end.
                with contextlib.suppress(BlockingIOError):
                    heart.send(b".")
                with contextlib.suppress(BlockingIOError):
                    if not heart.recv(1):
                        return
            except (BrokenPipeError, ConnectionResetError):
                return
            await asyncio.sleep(period_s)
