"""Server of the board: connections to its clients, and the calls of its functions."""

from __future__ import annotations

import logging
import select
import socket
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, Literal, NamedTuple, get_type_hints

import msgspec

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.drivers.simulation import Edge
from shapechanger.robot.twin.messages import (
    MAX_MESSAGE,
    Call,
    Event,
    Greeting,
    InputEdges,
    Reply,
    Role,
    decode_call,
    encode,
)
from shapechanger.robot.twin.pin_board import PinBoard

START_NS: Final = 1_000_000_000
"""First time of the twin's clock; not 0, which could be taken for "never"."""

LATER: Final = object()
"""Result of a call that is answered later, or never."""

_MAX_OUTBOX: Final = 256  # Messages kept for a client that does not read, before edges are merged.
_MAX_EDGES: Final = 500  # Most edges in one message, so that it stays below `MAX_MESSAGE`.
_READABLE: Final = select.EPOLLIN | select.EPOLLHUP | select.EPOLLERR

_log = logging.getLogger(__name__)


class OwnerGone(Exception):
    """The process at the other end of the owner's descriptor has ended."""


class BoardConnection:
    """The board's end of the connection to a client, which never blocks."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self._socket = connected
        # Encoded messages, each with its edges; () in replies and grants.
        self._outbox: deque[tuple[bytes, Sequence[Edge]]] = deque()
        self.role: Role = "clock"
        self.pid = 0
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

    def receive(self) -> Call | None:
        """Return the next call; None without a waiting call."""
        try:
            data = self._socket.recv(MAX_MESSAGE)
        except BlockingIOError:
            return None
        except OSError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        try:
            return decode_call(data)
        except msgspec.MsgspecError as error:
            _log.warning("process %d sends a malformed request: %s", self.pid, error)
            raise EOFError from error

    def send(self, event: Event) -> None:
        """Send a message, now or when the client reads."""
        edges = event.edges if isinstance(event, InputEdges) else ()
        self._outbox.append((encode(event), edges))
        self.flush()

    def send_edges(self, edges: Iterable[Edge]) -> None:
        """Send edges of the client's inputs, in order of time.

        A client that does not read loses edges, as in the kernel, but never a reply or a grant:
        beyond 256 messages, only the last of the waiting edges of each input is kept.
        """
        edges = list(edges)
        if len(self._outbox) >= _MAX_OUTBOX:
            waiting = [edge for _, edges in self._outbox for edge in edges]
            self._outbox = deque(message for message in self._outbox if not message[1])
            edges = sorted({edge.pin: edge for edge in (*waiting, *edges)}.values())
        for start in range(0, len(edges), _MAX_EDGES):
            self.send(InputEdges(edges[start : start + _MAX_EDGES]))

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


class Function(NamedTuple):
    """A function that clients may call, and the decoder of its arguments.

    The server passes "hardware" the connection and the time first, "time" the connection and the id
    of the call, and "operator" nothing.
    """

    run: Callable[..., object]
    decode: Callable[[bytes], tuple[Any, ...]]
    takes: Literal["hardware", "time", "operator"]


def functions_of(
    takes: Literal["hardware", "time", "operator"], functions: Iterable[Callable[..., object]]
) -> dict[str, Function]:
    """Return the functions for `BoardServer`, keyed by name."""
    found: dict[str, Function] = {}
    for function in functions:
        hints = get_type_hints(function)
        hints.pop("return", None)
        kinds = [*hints.values()][0 if takes == "operator" else 2 :]
        decode = msgspec.msgpack.Decoder(tuple[*kinds] if kinds else tuple[()]).decode
        found[function.__name__.lstrip("_")] = Function(function, decode, takes)
    return found


class BoardServer:
    """Accepts clients and executes their calls."""

    def __init__(
        self,
        listening: socket.socket,
        owner_fd: int,
        pins: PinBoard,
        clock: Literal["real", "twin"],
        now_ns: Callable[[], int],
        functions: dict[str, Function],
    ) -> None:
        self._listening = listening
        listening.setblocking(False)
        self._owner_fd = owner_fd
        self._pins = pins
        self._clock: Literal["real", "twin"] = clock
        self._now_ns = now_ns
        self._functions = functions_of("hardware", pins.functions) | functions
        self._functions |= functions_of("time", (self._greet, self._leave))
        self._epoll = select.epoll()
        self._epoll.register(listening, select.EPOLLIN)
        self._epoll.register(owner_fd, select.EPOLLIN)
        self._by_fd: dict[int, BoardConnection] = {}

    @property
    def connections(self) -> Sequence[BoardConnection]:
        """Connected clients, in the order in which they connected."""
        return tuple(self._by_fd.values())

    def serve(self, timeout_s: float | None) -> None:
        """Wait for calls and execute them."""
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
        for connection in self.connections if edges else ():
            own = [edge for edge in edges if self._pins.reader(edge.pin) is connection]
            if own:
                connection.send_edges(own)
                self._watch(connection)

    def send(self, connection: BoardConnection, event: Event) -> None:
        """Send a message to a client, now or when it reads."""
        connection.send(event)
        if connection.wants_to_write:
            self._watch(connection)

    def reply(self, connection: BoardConnection, call_id: int, result: object) -> None:
        """Send the result of a call, which msgspec can encode."""
        self.send(connection, Reply(call_id, msgspec.Raw(encode(result))))

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
        """Execute all calls that have arrived from a client."""
        try:
            while (call := connection.receive()) is not None:
                self._execute(connection, call)
        except EOFError:
            self._forget(connection)

    def _execute(self, connection: BoardConnection, call: Call) -> None:
        result: object = LATER
        error, number = "", 0
        try:
            result = self._result(connection, call)
        except ShapechangerError as refusal:  # For example of a course: the board runs on.
            error = str(refusal)
        except OSError as refusal:
            number = refusal.errno or 0
        if call.id is None:
            if error or number:
                _log.warning("process %d: %s", connection.pid, error or f"errno {number}")
        elif error or number:
            self.send(connection, Reply(call.id, error=error, errno=number))
        elif result is not LATER:
            self.reply(connection, call.id, result)

    def _result(self, connection: BoardConnection, call: Call) -> object:
        function = self._functions.get(call.function)
        if function is None:
            raise RobotError(f"The board has no function {call.function!r}.")
        try:
            arguments = function.decode(call.arguments)
        except msgspec.MsgspecError as error:
            raise RobotError(f"The board's {call.function} takes others: {error}.") from error
        if connection.role == "operator":
            self._catch_up()
        match function.takes:
            case "operator":
                return function.run(*arguments)
            case "time":
                return function.run(connection, call.id or 0, *arguments)
            case "hardware":
                t = self._now_ns() if self._clock == "twin" else call.t
                if call.function == "claim":
                    holder = self._pins.owner(arguments[0])
                    if isinstance(holder, BoardConnection) and holder is not connection:
                        self._execute_all(holder)  # It may have ended meanwhile.
                return function.run(connection, t, *arguments)

    def _greet(self, connection: BoardConnection, _: int, role: Role, pid: int) -> Greeting:
        connection.role, connection.pid = role, pid
        return Greeting(self._clock, self._now_ns())

    def _leave(self, connection: BoardConnection, _: int) -> None:
        connection.has_left = True

    def _catch_up(self) -> None:
        """Execute all that processes have sent until now, and notice which have ended."""
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
