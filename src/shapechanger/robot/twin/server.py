"""Server of the board: connections to its clients, and their requests."""

from __future__ import annotations

import logging
import select
import socket
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, Literal

import msgspec

from shapechanger.errors import ShapechangerError
from shapechanger.robot.drivers.simulation import Edge
from shapechanger.robot.twin.messages import (
    MAX_EDGES,
    MAX_MESSAGE,
    BoardEvent,
    BoardGreeting,
    BoardReply,
    ClaimPin,
    ConnectClient,
    DrivePin,
    HardwareRequest,
    InputEdges,
    InstructServos,
    LeaveBoard,
    PulsePin,
    ReadChip,
    Request,
    Role,
    WriteChip,
    decode_request,
    encode,
)
from shapechanger.robot.twin.pin_board import PinBoard

START_NS: Final = 1_000_000_000
"""First time of the twin's clock; not 0, which could be taken for "never"."""

_MAX_OUTBOX: Final = 256
"""Messages kept for a client that does not read, before edges are merged."""
_READABLE: Final = select.EPOLLIN | select.EPOLLHUP | select.EPOLLERR

_log = logging.getLogger(__name__)


class OwnerGone(Exception):
    """The process at the other end of the owner's descriptor has ended."""


class BoardConnection:
    """The board's end of the connection to a client, which never blocks.

    Args:
        connected: Its socket.

    Attributes:
        role: Role of the client.
        pid: Process id of the client.
        inputs: Pins whose edges it receives.
        takes_part: Whether time waits for it.
        works: Whether it has a grant that it has not finished.
        until_ns: Time at which it wants its next grant at the latest.
        has_left: Whether it has announced that it closes the connection.
    """

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self._socket = connected
        # Encoded messages, each with its edges; () in replies and grants.
        self._outbox: deque[tuple[bytes, Sequence[Edge]]] = deque()
        self.role: Role = "clock"
        self.pid = 0
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
            _log.warning("process %d sends a malformed request: %s", self.pid, error)
            raise EOFError from error

    def send(self, event: BoardEvent) -> None:
        """Send a message, now or when the client reads."""
        edges = event.edges if isinstance(event, InputEdges) else ()
        self._outbox.append((encode(event), edges))
        self.flush()

    def send_edges(self, edges: Iterable[Edge]) -> None:
        """Send the edges of the client's inputs.

        A client that does not read loses edges, as in the kernel, but never a reply or a grant:
        beyond 256 messages, only the last of the waiting edges of each input is kept.

        Args:
            edges: All edges, in order of time.
        """
        wanted = [edge for edge in edges if edge.pin in self.inputs]
        if not wanted:
            return
        if len(self._outbox) >= _MAX_OUTBOX:
            waiting = [edge for _, edges in self._outbox for edge in edges]
            last = {edge.pin: edge for edge in (*waiting, *wanted) if edge.pin in self.inputs}
            self._outbox = deque(message for message in self._outbox if not message[1])
            wanted = sorted(last.values())
        for start in range(0, len(wanted), MAX_EDGES):
            self.send(InputEdges(wanted[start : start + MAX_EDGES]))

    def flush(self) -> None:
        """Send waiting messages as far as the client reads."""
        while self._outbox:
            try:
                self._socket.send(self._outbox[0][0])
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
"""Executes a request of time or of an operator; returns its result, or `LATER`."""

LATER: Final = object()
"""Result of a request that is answered later, or never."""


class BoardServer:
    """Accepts clients and executes their requests.

    Args:
        listening: Listening socket.
        owner_fd: Descriptor whose end ends the board.
        pins: Pins, chips and servos.
        clock: Kind of clock.
        now_ns: Time of that clock.
        operate: Executes the requests of time and of operators.
    """

    def __init__(
        self,
        listening: socket.socket,
        owner_fd: int,
        pins: PinBoard,
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
                connection.send_edges(edges)
                self._watch(connection)

    def send(self, connection: BoardConnection, event: BoardEvent) -> None:
        """Send a message to a client, now or when it reads.

        Args:
            connection: The client.
            event: The message.
        """
        connection.send(event)
        if connection.wants_to_write:
            self._watch(connection)

    def reply(self, connection: BoardConnection, request_id: int, result: object) -> None:
        """Send the result of a request.

        Args:
            connection: The client.
            request_id: Id of its request.
            result: The result, which msgspec can encode.
        """
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
                _log.warning("process %d: %s", connection.pid, error or f"errno {number}")
        elif error or number:
            self.send(connection, BoardReply(request.id, error=error, errno=number))
        elif result is not LATER:
            self.reply(connection, request.id, result)

    def _result(self, connection: BoardConnection, request: Request) -> object:
        match request:
            case ClaimPin():
                return self._claim(connection, request)
            case DrivePin() | PulsePin() | ReadChip() | WriteChip() | InstructServos():
                return self._execute_on_hardware(connection, request)
            case ConnectClient():
                connection.role = request.role
                connection.pid = request.pid
                return BoardGreeting(self._clock, self._now_ns())
            case LeaveBoard():
                connection.has_left = True
            case _:
                if connection.role == "operator":
                    self._catch_up()
                return self._operate(connection, request)
        return None

    def _execute_on_hardware(self, connection: BoardConnection, request: HardwareRequest) -> object:
        if self._clock == "twin":
            request.t = self._now_ns()
        return self._pins.execute(connection, request)

    def _claim(self, connection: BoardConnection, request: ClaimPin) -> object:
        holder = self._pins.owner(request.pin)
        if isinstance(holder, BoardConnection) and holder is not connection:
            self._execute_all(holder)  # It may have ended meanwhile.
        level = self._execute_on_hardware(connection, request)
        if request.mode == "input":
            connection.inputs.add(request.pin)
        else:
            connection.inputs.discard(request.pin)
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
            self._pins.leave(connection, self._now_ns(), died=not connection.has_left)
        connection.close()
