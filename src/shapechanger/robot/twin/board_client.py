"""Connection of a process to the board, and the clocks that come with it."""

from __future__ import annotations

import os
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final, Literal, TypeVar

import msgspec

from shapechanger.errors import RobotError
from shapechanger.robot.twin.messages import (
    MAX_MESSAGE,
    BoardGreeting,
    BoardReply,
    ConnectClient,
    GrantTime,
    InputEdges,
    LeaveBoard,
    Request,
    Role,
    SleepOnBoard,
    SleepResult,
    WaitForGrant,
    decode_event,
    encode,
)

Result = TypeVar("Result")

_HELD_UP_MS: Final = 10  # Between two calls while the board does not reply.
_HELD_UP_S: Final = 10.0  # A board that does not reply for longer is broken.


class BoardClient:
    """A connection to the board, to be used by one thread; see `BoardPins` for the pins.

    Args:
        path: Socket on which the board listens.
        role: What the client is to the board.

    Attributes:
        clock: Kind of clock, "real" or "twin".
        now_ns: Newest twin time that the board has sent; with the clock "real", the time of the
            connection.
        levels: Level of each pin that is claimed as an input.
        on_edge: Called by `dispatch` with pin, level and time of each edge.
        while_held_up: Called every 10 ms while the board is held up and neither takes a request nor
            replies to it, for 10 s at most.

    Raises:
        RobotError: If no board listens there.
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
        self._replies: dict[int, BoardReply] = {}
        self.levels: dict[int, int] = {}
        self.on_edge: Callable[[int, int, int], None] | None = None
        self.while_held_up: Callable[[], object] = lambda: None
        greeting = self.ask(ConnectClient(role=role, pid=os.getpid()), BoardGreeting)
        self.clock: Literal["real", "twin"] = greeting.clock
        self.now_ns = greeting.t

    @property
    def closed(self) -> bool:
        """True if `close` was called."""
        return self._socket.fileno() < 0

    def fileno(self) -> int:
        """Return the descriptor of the connection."""
        return self._socket.fileno()

    def post(self, request: Request) -> None:
        """Send a request without waiting for a reply.

        Raises:
            RobotError: If the board is gone.
        """
        data, until_s = encode(request), time.monotonic() + _HELD_UP_S
        while True:
            try:
                self._socket.send(data, socket.MSG_DONTWAIT)
            except BlockingIOError:
                self._await(self._writable, until_s)
            except OSError as error:
                raise RobotError("The twin's board is gone.") from error
            else:
                return

    def ask(self, request: Request, kind: type[Result] | Any = None) -> Any:
        """Send a request and wait for its reply.

        Args:
            request: The request.
            kind: Type of the result.

        Raises:
            RobotError: If the board refuses, or is gone.
            OSError: If a chip does not answer, as smbus2 raises it.
        """
        self._last_id += 1
        request.id = self._last_id
        self.post(request)
        until_s = time.monotonic() + _HELD_UP_S
        while request.id not in self._replies:
            self._await(self._readable, until_s)
            self._receive(socket.MSG_DONTWAIT)
        reply = self._replies.pop(request.id)
        if reply.error:
            raise RobotError(reply.error)
        if reply.errno:
            raise OSError(reply.errno, os.strerror(reply.errno))
        return msgspec.msgpack.decode(reply.result, type=kind)

    def drain(self) -> None:
        """Receive everything that has arrived, without waiting."""
        while self._receive(socket.MSG_DONTWAIT):
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
                self._socket.send(encode(LeaveBoard()))
            except OSError:
                pass  # The board ended first.
            finally:
                self._socket.close()

    def _await(self, ready: select.poll, until_s: float) -> None:
        """Wait for the board, which a busy machine or a new world may hold up."""
        while not ready.poll(_HELD_UP_MS):
            if time.monotonic() < until_s:
                self.while_held_up()

    def _receive(self, flags: int) -> bool:
        """Receive one message; False if there is none."""
        try:
            data = self._socket.recv(MAX_MESSAGE, flags)
        except BlockingIOError:
            return False
        except OSError as error:
            raise RobotError("The twin's board is gone.") from error
        if not data:
            raise RobotError("The twin's board is gone.")
        match decode_event(data):
            case GrantTime(t=t):
                self._grants.append(t)
            case InputEdges(edges=edges):
                for edge in edges:
                    self.levels[edge.pin] = edge.level
                    self._edges.append((edge.pin, edge.level, edge.t))
            case BoardReply() as reply:
                self._replies[reply.id] = reply
        return True


class SteadyClock:
    """The machine's monotonic clock; edges of inputs are dispatched while the guard waits.

    Args:
        client: Connection to the board.
    """

    def __init__(self, client: BoardClient) -> None:
        self._client = client

    def now_ns(self) -> int:
        """Return the time of CLOCK_MONOTONIC in nanoseconds."""
        return time.monotonic_ns()

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait until a descriptor can be read or it is `until_ns`; see `Clock.wait`."""
        latest_ns = min(until_ns, time.monotonic_ns() + int(at_most_s * 1e9))
        board = self._client.fileno()
        poll = select.poll()
        for fd in {*readable, board}:
            poll.register(fd, select.POLLIN)
        while True:
            left_ms = max(0.0, (latest_ns - time.monotonic_ns()) / 1e6)
            ready = {fd for fd, _ in poll.poll(left_ms)}
            if board in ready:
                self._client.drain()
            self._client.dispatch()
            now_ns = time.monotonic_ns()
            if ready - {board} or now_ns >= latest_ns:
                return bool(ready - {board}) or now_ns >= until_ns

    def keep_alive(self, beat: Callable[[], object]) -> None:
        """Call `beat` while the board does not reply; see `Clock.keep_alive`."""
        self._client.while_held_up = beat

    async def sleep(self, seconds: float) -> None:
        """Sleep in real time."""
        import asyncio  # Only the daemon sleeps; the guard stays light.

        await asyncio.sleep(seconds)


class GrantedClock:
    """The twin's own clock, which the board advances.

    A process that calls `wait` takes part: time advances only while all participants wait.

    Args:
        client: Connection to the board.
        path: Socket of the board; each `sleep` in progress needs a connection of its own.
    """

    def __init__(self, client: BoardClient, path: str) -> None:
        self._client = client
        self._path = path
        self._waiting = False
        self._idle: list[socket.socket] = []

    def now_ns(self) -> int:
        """Return the newest twin time that this process has received."""
        return self._client.now_ns

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Finish the last grant and wait for the next; see `Clock.wait`.

        A grant arrives at each tick of the board, and at `until_ns` if that is earlier.
        """
        if not self._waiting:
            self._client.post(WaitForGrant(until_ns=until_ns))
            self._waiting = True
        if not self._client.await_grant(at_most_s):
            return False
        self._waiting = False
        return True

    def keep_alive(self, beat: Callable[[], object]) -> None:
        """Call `beat` while the board does not reply; see `Clock.keep_alive`."""
        self._client.while_held_up = beat

    async def sleep(self, seconds: float) -> int | None:
        """Let twin time advance, and return when the newest picture was taken."""
        import asyncio  # Only the daemon sleeps; the guard stays light.

        loop = asyncio.get_running_loop()
        connected = bool(self._idle)
        if connected:
            connection = self._idle.pop()
        else:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            connection.setblocking(False)
        try:
            if not connected:
                await loop.sock_connect(connection, self._path)
            request = SleepOnBoard(ns=max(0, round(seconds * 1e9)), id=0)
            await loop.sock_sendall(connection, encode(request))
            data = await loop.sock_recv(connection, MAX_MESSAGE)
            if not data:
                raise RobotError("The twin's board is gone.")
        except BaseException as error:
            # Also when cancelled: a reply that is still due would answer the next sleep.
            connection.close()
            if isinstance(error, OSError):
                raise RobotError("The twin's board is gone.") from error
            raise
        self._idle.append(connection)
        reply = decode_event(data)
        if not isinstance(reply, BoardReply) or reply.error:
            raise RobotError(getattr(reply, "error", "") or "The twin's board does not sleep.")
        slept = msgspec.msgpack.decode(reply.result, type=SleepResult)
        self._client.now_ns = max(self._client.now_ns, slept.t)
        return slept.captured_ns

    def close(self) -> None:
        """Close the connections of `sleep`."""
        while self._idle:
            self._idle.pop().close()
