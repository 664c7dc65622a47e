"""The board's server: its clients, what they may do with pins and chips, and the time.

`RealTime` follows the machine's clock. `TwinTime` advances only while a client sleeps, and waits
for all clients that take part.
"""

from __future__ import annotations

import logging
import select
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple

import msgspec

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.twin.camera import FrontCameraPipe
from shapechanger.twin.messages import (
    MAX_EDGES,
    MAX_MESSAGE,
    BoardEvent,
    BoardGreeting,
    BoardReply,
    ClaimPin,
    ConnectClient,
    DrivePin,
    Edge,
    GrantTime,
    InputEdges,
    LeaveBoard,
    PulsePin,
    ReadChip,
    Request,
    Role,
    SleepResult,
    WriteChip,
    decode_request,
    encode,
)
from shapechanger.twin.pin_board import Owner, PinBoard

__all__ = ["START_NS", "BoardConnection", "BoardServer", "OwnerGone", "RealTime", "TwinTime"]

START_NS: Final = 1_000_000_000
"""First time of the twin's clock; not 0, which could be taken for "never"."""

_MAX_OUTBOX: Final = 256
"""Messages kept for a client that does not read; beyond it edges are lost, as in the kernel."""
_READABLE: Final = select.EPOLLIN | select.EPOLLHUP | select.EPOLLERR
_WORLD_STEP_NS: Final = 10_000_000
_LOOK_FOR_READER_S: Final = 0.05
"""Interval of looking for a reader of the pictures while time stands still."""

_log = logging.getLogger(__name__)


class OwnerGone(Exception):
    """The process at the other end of the owner's descriptor has ended."""


class BoardConnection:
    """The board's end of the connection to a client, which never blocks.

    Args:
        connected: Its socket.

    Attributes:
        role: Role of the client.
        owner: Owner of the pins that it claims.
        inputs: Pins whose edges it receives.
        takes_part: Whether time waits for it.
        works: Whether it has a grant that it has not finished.
        until_ns: Time at which it wants its next grant at the latest.
        has_left: Whether it has announced that it closes the connection.
    """

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self._socket = connected
        self._outbox: deque[bytes] = deque()
        self.role: Role = "clock"
        self.owner = Owner(self, 0)
        self.inputs: set[int] = set()
        self.takes_part = False
        self.works = False
        self.until_ns = 0
        self.has_left = False

    def fileno(self) -> int:
        """Return the descriptor of the connection."""
        return self._socket.fileno()

    @property
    def wants_to_write(self) -> bool:
        """True if messages wait for the client to read."""
        return bool(self._outbox)

    def receive(self) -> Request | None:
        """Return the next request; None if there is none now.

        Raises:
            EOFError: If the client is gone, or sends nonsense.
        """
        try:
            data = self._socket.recv(MAX_MESSAGE)
        except BlockingIOError:
            return None
        except OSError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        try:
            return decode_request(data)
        except msgspec.MsgspecError as error:
            _log.warning("process %d sends a malformed request: %s", self.owner.pid, error)
            raise EOFError from error

    def send(self, event: BoardEvent) -> None:
        """Send a message, now or when the client reads."""
        self._outbox.append(encode(event))
        self.flush()

    def send_edges(self, edges: Iterable[Edge], levels: Mapping[int, int]) -> None:
        """Send the edges of the client's inputs.

        Args:
            edges: All edges, in order of time.
            levels: Level of each input after them.
        """
        wanted = [edge for edge in edges if edge.pin in self.inputs]
        if not wanted:
            return
        if len(self._outbox) >= _MAX_OUTBOX:
            # The client is too slow: it gets the last levels, without the edges that led to them.
            self._outbox.pop()
            t = wanted[-1].t
            wanted = [Edge(t, pin, levels.get(pin, 0)) for pin in sorted(self.inputs)]
        for start in range(0, len(wanted), MAX_EDGES):
            self.send(InputEdges(wanted[start : start + MAX_EDGES]))

    def flush(self) -> None:
        """Send waiting messages as far as the client reads."""
        while self._outbox:
            try:
                self._socket.send(self._outbox[0])
            except BlockingIOError:
                return
            except OSError:
                self._outbox.clear()  # The client is gone, which the next `receive` reports.
                return
            self._outbox.popleft()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


Operate = Callable[[BoardConnection, Request], Any]
"""Executes a request about neither pins nor chips; returns its result, or `LATER`."""

LATER: Final = object()
"""Result of a request that is answered later, or never."""


class BoardServer:
    """Accepts clients and executes their requests.

    Args:
        listening: Listening socket.
        owner_fd: Descriptor whose end ends the board.
        pins: Pins and chips.
        input_levels: Levels of the pins that sensors drive, kept up to date by the sensors.
        clock: Kind of clock.
        now_ns: Time of that clock.
        operate: Executes the requests that are not about pins and chips.
    """

    def __init__(
        self,
        listening: socket.socket,
        owner_fd: int,
        pins: PinBoard,
        input_levels: Mapping[int, int],
        clock: Literal["real", "twin"],
        now_ns: Callable[[], int],
        operate: Operate,
    ) -> None:
        self._listening = listening
        listening.setblocking(False)
        self._owner_fd = owner_fd
        self._pins = pins
        self._clock: Literal["real", "twin"] = clock
        self._now_ns = now_ns
        self._operate = operate
        self._input_levels = input_levels
        self._epoll = select.epoll()
        self._epoll.register(listening, select.EPOLLIN)
        self._epoll.register(owner_fd, select.EPOLLIN)
        self._by_fd: dict[int, BoardConnection] = {}

    @property
    def connections(self) -> Sequence[BoardConnection]:
        """Connected clients, in the order in which they connected."""
        return tuple(self._by_fd.values())

    def serve(self, timeout_s: float | None) -> None:
        """Wait for requests and execute them.

        Raises:
            OwnerGone: If the owner has ended.
        """
        new = False
        for fd, events in self._epoll.poll(timeout_s):
            if fd == self._listening.fileno():
                new = True  # Last, so that the successor of a process that died follows its end.
            elif fd == self._owner_fd:
                raise OwnerGone
            elif (connection := self._by_fd.get(fd)) is not None:
                if events & select.EPOLLOUT:
                    connection.flush()
                    self._watch(connection)
                if events & _READABLE:
                    self._execute_all(connection)
        if new:
            self._accept()

    def send_edges(self, edges: Sequence[Edge]) -> None:
        """Send the edges of inputs to the clients that claimed them."""
        if edges:
            for connection in self.connections:
                connection.send_edges(edges, self._input_levels)
                self._watch(connection)

    def send(self, connection: BoardConnection, event: BoardEvent) -> None:
        """Send a message to a client."""
        connection.send(event)
        if connection.wants_to_write:
            self._watch(connection)

    def reply(self, connection: BoardConnection, request_id: int, result: object) -> None:
        """Send the result of a request."""
        self.send(connection, BoardReply(request_id, msgspec.Raw(encode(result))))

    def close(self) -> None:
        """Close all sockets."""
        for connection in self._by_fd.values():
            connection.close()
        self._epoll.close()
        self._listening.close()

    def _accept(self) -> None:
        while True:
            try:
                connected, _ = self._listening.accept()
            except BlockingIOError:
                return
            connection = BoardConnection(connected)
            self._by_fd[connection.fileno()] = connection
            self._epoll.register(connection.fileno(), select.EPOLLIN)

    def _watch(self, connection: BoardConnection) -> None:
        if connection.fileno() in self._by_fd:
            writing = select.EPOLLOUT if connection.wants_to_write else 0
            self._epoll.modify(connection.fileno(), select.EPOLLIN | writing)

    def _execute_all(self, connection: BoardConnection) -> None:
        """Execute all requests that have arrived from a client."""
        try:
            while (request := connection.receive()) is not None:
                self._execute(connection, request)
        except EOFError:
            self._forget(connection)

    def _execute(self, connection: BoardConnection, request: Request) -> None:
        result: object = LATER
        error, number = "", 0
        try:
            result = self._result(connection, request)
        except ShapechangerError as refusal:  # For example of a course: the board runs on.
            error = str(refusal)
        except OSError as refusal:
            number = refusal.errno or 0
        if request.id is None:
            if error or number:
                _log.warning("process %d: %s", connection.owner.pid, error or f"errno {number}")
        elif error or number:
            self.send(connection, BoardReply(request.id, error=error, errno=number))
        elif result is not LATER:
            self.reply(connection, request.id, result)

    def _result(self, connection: BoardConnection, request: Request) -> object:
        match request:
            case DrivePin():
                t = self._stamp(request.t)
                self._pins.drive(connection.owner, request.pin, request.duty, request.hz, t)
            case PulsePin():
                t = self._stamp(request.t)
                self._pins.pulse(connection.owner, request.pin, request.us, request.hz, t)
            case ReadChip():
                return self._pins.read_chip(
                    request.bus, request.address, request.register, request.length
                )
            case WriteChip():
                self._pins.write_chip(
                    connection.owner.pid,
                    request.bus,
                    request.address,
                    request.register,
                    request.data,
                    self._stamp(request.t),
                )
            case ClaimPin():
                return self._claim(connection, request)
            case ConnectClient():
                connection.role = request.role
                connection.owner = Owner(connection, request.pid)
                return BoardGreeting(self._clock, self._now_ns())
            case LeaveBoard():
                connection.has_left = True
            case _:
                if connection.role == "operator":
                    self._catch_up()
                return self._operate(connection, request)
        return None

    def _claim(self, connection: BoardConnection, request: ClaimPin) -> int:
        pin, mode = request.pin, request.mode
        holder = self._pins.owner(pin)
        other = None if holder is None else holder.connection
        if isinstance(other, BoardConnection) and other is not connection:
            self._execute_all(other)  # It may have ended meanwhile.
        t = self._stamp(request.t)
        level = self._pins.claim(connection.owner, pin, mode, request.pull, request.level, t)
        if mode == "input":
            connection.inputs.add(pin)
            level = self._input_levels.get(pin, level)
        else:
            connection.inputs.discard(pin)
        return level

    def _catch_up(self) -> None:
        """Execute what processes have sent until now, and notice which have ended."""
        for connection in self.connections:
            if connection.role == "hardware":
                self._execute_all(connection)

    def _forget(self, connection: BoardConnection) -> None:
        if self._by_fd.pop(connection.fileno(), None) is None:
            return
        self._epoll.unregister(connection.fileno())
        if connection.role == "hardware":
            self._pins.leave(connection.owner, self._now_ns(), died=not connection.has_left)
        connection.close()

    def _stamp(self, t: int) -> int:
        return self._now_ns() if self._clock == "twin" else t


class RealTime:
    """CLOCK_MONOTONIC; the world advances in steps of 10 ms."""

    clock: Literal["real", "twin"] = "real"

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return time.monotonic_ns()

    def sleep(self, connection: BoardConnection, request_id: int, ns: int) -> None:
        """Refuse: real time advances by itself."""
        raise RobotError("This board runs in real time, which cannot be advanced.")

    def wait(self, connection: BoardConnection, until_ns: int) -> None:
        """Refuse: real time is not granted."""
        raise RobotError("This board runs in real time, which is not granted.")

    def run(
        self,
        server: BoardServer,
        camera: FrontCameraPipe | None,
        advance: Callable[[int], None],
        take_picture: Callable[[int], None],
    ) -> None:
        """Run until the owner is gone.

        Args:
            server: Server of the clients.
            camera: Camera, for the time of its next picture.
            advance: Advances the world to a time.
            take_picture: Takes the picture that is due at a time.
        """
        step_ns = self.now_ns()
        while True:
            due_ns = step_ns if camera is None else min(step_ns, camera.next_ns)
            server.serve(max(0, due_ns - self.now_ns()) / 1e9)
            now_ns = self.now_ns()
            if now_ns >= due_ns:
                advance(now_ns)
                step_ns = now_ns + _WORLD_STEP_NS if now_ns >= step_ns else step_ns
                if camera is not None and now_ns >= camera.next_ns:
                    take_picture(now_ns)


class _Sleeper(NamedTuple):
    """A client that sleeps, ordered by the end of its sleep and then by arrival."""

    until_ns: int
    number: int
    connection: BoardConnection
    request_id: int


class TwinTime:
    """Time that advances only while a client sleeps, and waits for all that take part.

    Args:
        tick_hz: Rate of the grants of time, Hz; a client may ask for further ones in between.
    """

    clock: Literal["real", "twin"] = "twin"

    def __init__(self, tick_hz: float) -> None:
        self._tick_hz = tick_hz
        self._now_ns = START_NS
        self._ticks = 0
        self._sleepers: list[_Sleeper] = []
        self._sleeps = 0

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return self._now_ns

    def sleep(self, connection: BoardConnection, request_id: int, ns: int) -> None:
        """Let a client sleep."""
        self._sleeps += 1
        self._sleepers.append(_Sleeper(self._now_ns + ns, self._sleeps, connection, request_id))

    def wait(self, connection: BoardConnection, until_ns: int) -> None:
        """Finish the grant of a client, which takes part from now on."""
        connection.takes_part = True
        connection.works = False
        connection.until_ns = until_ns

    def run(
        self,
        server: BoardServer,
        camera: FrontCameraPipe | None,
        advance: Callable[[int], None],
        take_picture: Callable[[int], None],
    ) -> None:
        """Run until the owner is gone; see `RealTime.run`."""
        while True:
            if self._sleepers:
                server.serve(0.0)
            else:
                found = camera is None or camera.find_reader()
                server.serve(None if found else _LOOK_FOR_READER_S)
            # Clients that are gone no longer sleep.
            self._sleepers = [one for one in self._sleepers if one.connection.fileno() >= 0]
            if not self._sleepers:
                continue
            first = min(self._sleepers)
            if first.until_ns > self._now_ns:
                self._step(first.until_ns, server, camera, advance, take_picture)
            if first.until_ns <= self._now_ns:
                self._sleepers.remove(first)
                newest_ns = None if camera is None else camera.newest_ns
                result = SleepResult(self._now_ns, newest_ns)
                server.reply(first.connection, first.request_id, result)

    def _step(
        self,
        end_ns: int,
        server: BoardServer,
        camera: FrontCameraPipe | None,
        advance: Callable[[int], None],
        take_picture: Callable[[int], None],
    ) -> None:
        """Advance to the next time at which anything happens."""
        participants = [one for one in server.connections if one.takes_part]
        wanted = [one.until_ns for one in participants if one.until_ns > self._now_ns]
        grant_ns = min(end_ns, self._next_tick_ns(), *wanted)
        picture_ns = grant_ns if camera is None else max(camera.next_ns, self._now_ns)
        self._now_ns = min(grant_ns, picture_ns)
        advance(self._now_ns)
        if camera is not None and camera.next_ns <= self._now_ns:
            take_picture(self._now_ns)
        if self._now_ns < grant_ns:
            return
        for connection in participants:
            connection.works = True
            server.send(connection, GrantTime(self._now_ns))
        while any(one.works and one.fileno() >= 0 for one in participants):
            server.serve(None)

    def _next_tick_ns(self) -> int:
        while (tick_ns := START_NS + round(self._ticks * 1e9 / self._tick_hz)) <= self._now_ns:
            self._ticks += 1
        return tick_ns
