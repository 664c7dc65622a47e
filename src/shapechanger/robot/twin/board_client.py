"""Connection of a process to the board."""

from __future__ import annotations

import os
import select
import socket
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Literal

import msgspec

from shapechanger.errors import RobotError
from shapechanger.robot.twin.messages import (
    MAX_MESSAGE,
    Grant,
    Greeting,
    InputEdges,
    Reply,
    Role,
    decode_event,
    encode_call,
)

_HELD_UP_MS: Final = 10  # Between two calls while the board does not reply.
_HELD_UP_S: Final = 10.0  # A board that does not reply for longer is broken.


class BoardClient:
    """A connection to the board, to be used by one thread.

    Attributes:
        clock: Kind of clock, "real" or "twin".
        now_ns: Newest twin time that the board has sent; with the clock "real", the time of the
            connection.
        levels: Level of each pin that is claimed as an input.
        on_edge: Called by `dispatch` with pin, level and time of each edge.
        while_held_up: Called every 10 ms while the board is held up and neither takes a request nor
            replies to it, for 10 s at most.
    """

    def __init__(self, path: str, role: Role) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._socket.connect(path)
        except OSError as error:
            self._socket.close()
            raise RobotError(f"No twin's board answers at {path}: {error.strerror}.") from error
        self._readable, self._writable = select.poll(), select.poll()
        self._readable.register(self._socket, select.POLLIN)
        self._writable.register(self._socket, select.POLLOUT)
        self._last_id = 0
        self._edges: deque[tuple[int, int, int]] = deque()
        self._grants: deque[int] = deque()
        self._replies: dict[int, Reply] = {}
        self.levels: dict[int, int] = {}
        self.on_edge: Callable[[int, int, int], None] | None = None
        self.while_held_up: Callable[[], object] = lambda: None
        greeting = self.ask(Greeting, "greet", role, os.getpid())
        self.clock: Literal["real", "twin"] = greeting.clock
        self.now_ns = greeting.t

    @property
    def closed(self) -> bool:
        """True if `close` was called."""
        return self._socket.fileno() < 0

    def fileno(self) -> int:
        """Return the descriptor of the connection."""
        return self._socket.fileno()

    def post(self, function: str, *arguments: object) -> None:
        """Call a function of the board without waiting for its end."""
        self._send(encode_call(function, *arguments, t=time.monotonic_ns()))

    def _send(self, data: bytes) -> None:
        until_s = time.monotonic() + _HELD_UP_S
        while True:
            try:
                self._socket.send(data, socket.MSG_DONTWAIT)
            except BlockingIOError:
                self._await(self._writable, until_s)
            except OSError as error:
                raise RobotError("The twin's board is gone.") from error
            else:
                return

    def ask(self, kind: Any, function: str, *arguments: object) -> Any:
        """Call a function of the board and return its result."""
        self._last_id += 1
        self._send(encode_call(function, *arguments, id=self._last_id, t=time.monotonic_ns()))
        until_s = time.monotonic() + _HELD_UP_S
        while self._last_id not in self._replies:
            self._await(self._readable, until_s)
            self._receive()
        reply = self._replies.pop(self._last_id)
        if reply.error:
            raise RobotError(reply.error)
        if reply.errno:
            raise OSError(reply.errno, os.strerror(reply.errno))
        return msgspec.msgpack.decode(reply.result, type=kind)

    def drain(self) -> None:
        """Receive everything that has arrived, without waiting."""
        while self._receive():
            pass

    def dispatch(self) -> None:
        """Call `on_edge` for all edges that have arrived."""
        while self._edges:
            edge = self._edges.popleft()
            if self.on_edge is not None:
                self.on_edge(*edge)

    def await_grant(self, at_most_s: float) -> bool:
        """Wait for a grant, which sets `now_ns`, and dispatch the edges before it."""
        while not self._grants:
            if not self._readable.poll(max(0.0, at_most_s * 1e3)):
                self.dispatch()
                return False
            self.drain()
        self.now_ns = self._grants.popleft()
        self.dispatch()
        return True

    def close(self) -> None:
        """Leave the board in order."""
        if not self.closed:
            try:
                self._socket.send(encode_call("leave"))
            except OSError:
                pass  # The board ended first.
            finally:
                self._socket.close()

    def _await(self, ready: select.poll, until_s: float) -> None:
        """Wait for the board, which a busy machine or a new world may hold up."""
        while not ready.poll(_HELD_UP_MS):
            if time.monotonic() < until_s:
                self.while_held_up()

    def _receive(self) -> bool:
        """Receive one message; False without one."""
        try:
            data = self._socket.recv(MAX_MESSAGE, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError as error:
            raise RobotError("The twin's board is gone.") from error
        if not data:
            raise RobotError("The twin's board is gone.")
        match decode_event(data):
            case Grant(t=t):
                self._grants.append(t)
            case InputEdges(edges=edges):
                for edge in edges:
                    self.levels[edge.pin] = edge.level
                    self._edges.append((edge.pin, edge.level, edge.t))
            case Reply() as reply:
                self._replies[reply.id] = reply
        return True
