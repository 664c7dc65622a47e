"""Links of the daemon to the guard and to the supervisor: orders, states and signs of life."""

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

LIFELINE: Final = b"life"
"""The message that carries the lifeline's descriptor."""

_log = logging.getLogger(__name__)

# Orders that must arrive in any case. One of each kind is enough, because repeats mean the same.
_URGENT: Final = ("end", "emergency", "disarm", "halt")
_CLONE_FILES: Final = 0x400  # linux/sched.h
_READY_S: Final = 1.0


class GuardLink:
    """Non-blocking socket to the guard: sends orders and receives states.

    A guard that does not read fills the socket. A command is then dropped, because it would be
    too old when the guard reads again, and a stop waits until there is room.
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
        """Read states in an event loop from now on."""
        self._loop = loop
        loop.add_reader(self._socket, self.drain)

    def send(self, order: Order) -> None:
        """Send an order."""
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
                _log.warning("A message of the guard is not a state: %s", error)
                continue
            self._on_state(state)

    def close(self) -> None:
        """Close the socket, which makes the guard stop the robot."""
        self._lost = True  # Nothing is sent from now on.
        if self._socket.fileno() >= 0:
            self._detach()
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
        self._detach()
        self._on_lost()

    def _detach(self) -> None:
        if self._loop is not None:
            self._loop.remove_reader(self._socket)
            self._loop.remove_writer(self._socket)


async def send_heartbeats(fd: int, period_s: float) -> None:
    """Send the supervisor a byte each period, until the supervisor is gone."""
    with socket.socket(fileno=fd) as heart:
        heart.setblocking(False)
        while True:
            try:
                # A full socket means that the supervisor does not read, not that it is gone.
                with contextlib.suppress(BlockingIOError):
                    heart.send(b".")
                with contextlib.suppress(BlockingIOError):
                    if not heart.recv(1):
                        return
            except (BrokenPipeError, ConnectionResetError):
                return
            await asyncio.sleep(period_s)


def send_lifeline(guard_fd: int) -> bool:
    """Send the guard a descriptor that closes as soon as this process dies.

    When a process is killed, the kernel frees its memory before it closes its files. For the
    daemon's 50 MB that takes 6 ms, in which the guard would wait for the end of the socket. The
    files of a thread that shares the memory but not the files close at once. Such a thread holds
    one end of a pipe, and the guard the other. `python -m benchmarks.run robot-faults` measures
    0.5 ms instead of 7 ms.

    Call this while few files are open and no other thread runs.

    Returns:
        False where the system cannot do it; the guard then waits for the end of the socket.
    """
    ours, theirs = os.pipe()
    # The new thread gets a copy of each file; this one is then closed here.
    apart = threading.Event()
    failed: list[bool] = []
    threading.Thread(
        target=_hold, args=(theirs, apart, failed), name="shapechanger-life", daemon=True
    ).start()
    held = apart.wait(_READY_S) and not failed
    os.close(theirs)
    if held:
        # If the guard is gone already, the reader of the socket notices.
        with (
            socket.socket(fileno=os.dup(guard_fd)) as guard,
            contextlib.suppress(BrokenPipeError, ConnectionResetError),
        ):
            socket.send_fds(guard, [LIFELINE], [ours])
    os.close(ours)
    return held


def _hold(fd: int, apart: threading.Event, failed: list[bool]) -> None:
    """Hold a file that no other thread has, until the process or the other end is gone."""
    unshare = getattr(ctypes.CDLL(None), "unshare", None)  # On Linux only.
    if unshare is None or unshare(_CLONE_FILES) != 0:
        failed.append(True)
        apart.set()
        return
    os.closerange(0, fd)
    os.closerange(fd + 1, os.sysconf("SC_OPEN_MAX"))
    ended = select.poll()
    ended.register(fd, 0)  # Only the error condition, that the other end is closed.
    apart.set()
    ended.poll()
