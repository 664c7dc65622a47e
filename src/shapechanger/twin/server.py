"""One client of the board."""

from __future__ import annotations

import logging
import select
import socket
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final

from shapechanger.errors import ShapechangerError
from shapechanger.twin import messages as wire
from shapechanger.twin.pin_board import Owner, PinBoard
from shapechanger.twin.sensors import Edge

__all__ = ["BoardConnection", "OwnerGone", "Switchboard"]

_MOST_WAITING: Final = 256
"""Messages that wait for a client that does not read; then edges are lost, as in the kernel."""


class BoardConnection:
    """One client; nothing here ever waits for it.

    Args:
        connected: Its socket.

    Attributes:
        role: "hardware", "operator" or "clock".
        owner: Whose pins it holds.
        inputs: Pins whose edges it wants.
        takes_part: Whether time waits for it.
        works: Whether it was granted time and has not said that it is done.
        until_ns: When it wants time at the latest.
        polite: Whether it said goodbye.
    """

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self._socket = connected
        self._outbox: deque[bytes] = deque()
        self.role = "clock"
        self.owner = Owner(self, 0)
        self.inputs: set[int] = set()
        self.takes_part = False
        self.works = False
        self.until_ns = 0
        self.polite = False

    def fileno(self) -> int:
        """The descriptor, to wait for."""
        return self._socket.fileno()

    @property
    def wants_to_write(self) -> bool:
        """Whether something waits for the client to read."""
        return bool(self._outbox)

    def receive(self) -> wire.Message | None:
        """The next message; None if there is none now.

        Raises:
            EOFError: If the client is gone.
        """
        try:
            data = self._socket.recv(wire.MAX_MESSAGE)
        except BlockingIOError:
            return None
        except OSError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        return wire.decode(data)

    def send(self, message: wire.Message) -> None:
        """Say something, now or when the client reads."""
        self._outbox.append(wire.encode(message))
        self.flush()

    def send_edges(self, edges: Iterable[Edge], levels: Mapping[int, int]) -> None:
        """Tell of those edges that the client wants."""
        wanted = [[edge.pin, edge.level, edge.t] for edge in edges if edge.pin in self.inputs]
        if not wanted:
            return
        if len(self._outbox) >= _MOST_WAITING:
            # Too slow: it gets the levels as they are in the end, and not how they came about.
            self._outbox.pop()
            wanted = [[pin, levels.get(pin, 0), wanted[-1][2]] for pin in sorted(self.inputs)]
        for start in range(0, len(wanted), wire.MOST_EDGES):
            self.send({"op": "inputs", "edges": wanted[start : start + wire.MOST_EDGES]})

    def flush(self) -> None:
        """Send what waits, as far as the client reads."""
        while self._outbox:
            try:
                self._socket.send(self._outbox[0])
            except BlockingIOError:
                return
            except OSError:
                self._outbox.clear()  # It is gone, which the next `receive` says.
                return
            self._outbox.popleft()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


_log = logging.getLogger(__name__)

_READABLE: Final = select.EPOLLIN | select.EPOLLHUP | select.EPOLLERR


class OwnerGone(Exception):
    """Whoever holds the other end of the owner's pipe has ended."""


Answer = Callable[[BoardConnection, wire.Message], wire.Message | None]


class Switchboard:
    """Accepts clients and hands on what they say.

    Args:
        listening: The socket.
        owner_fd: Descriptor whose end ends the board; None for none.
        pins: The pins and chips.
        input_levels: Levels of the pins that sensors drive, as they are now.
        clock: "real" or "twin".
        now_ns: The time on that clock.
        operate: Answers what is neither about pins nor about chips.

    Attributes:
        connections: Who is connected, in the order in which they came.
    """

    def __init__(
        self,
        listening: socket.socket,
        owner_fd: int | None,
        pins: PinBoard,
        input_levels: Mapping[int, int],
        clock: str,
        now_ns: Callable[[], int],
        operate: Answer,
    ) -> None:
        self._listening = listening
        listening.setblocking(False)
        self._owner_fd = owner_fd
        self._pins = pins
        self._clock = clock
        self._now_ns = now_ns
        self._operate = operate
        self._input_levels = input_levels
        self._epoll = select.epoll()
        self._epoll.register(listening, select.EPOLLIN)
        if owner_fd is not None:
            self._epoll.register(owner_fd, select.EPOLLIN)
        self._by_fd: dict[int, BoardConnection] = {}
        self._answers: dict[str, Answer] = {
            "hello": self._hello,
            "claim": self._claim,
            "pin": self._pin,
            "pulse": self._pulse,
            "read": self._read,
            "write": self._write,
            "bye": self._bye,
        }

    @property
    def connections(self) -> Sequence[BoardConnection]:
        """Who is connected."""
        return tuple(self._by_fd.values())

    def pump(self, timeout_s: float | None) -> None:
        """Wait until somebody says something, and answer it.

        Raises:
            OwnerGone: If the owner has ended.
        """
        new = False
        for fd, events in self._epoll.poll(timeout_s):
            if fd == self._listening.fileno():
                new = True  # Last: who takes over from a process that died comes after its end.
            elif fd == self._owner_fd:
                raise OwnerGone
            elif (connection := self._by_fd.get(fd)) is not None:
                if events & select.EPOLLOUT:
                    connection.flush()
                    self._watch(connection)
                if events & _READABLE:
                    self._serve(connection)
        if new:
            self._accept()

    def tell_edges(self, edges: Iterable[Edge]) -> None:
        """Tell everybody of the edges of their inputs."""
        edges = tuple(edges)
        if edges:
            for connection in self.connections:
                connection.send_edges(edges, self._input_levels)
                self._watch(connection)

    def send(self, connection: BoardConnection, message: wire.Message) -> None:
        """Say something to a client."""
        connection.send(message)
        if connection.wants_to_write:
            self._watch(connection)

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

    def _serve(self, connection: BoardConnection) -> None:
        """Answer all that a client has said."""
        try:
            while (message := connection.receive()) is not None:
                self._answer(connection, message)
        except EOFError:
            self._gone(connection)

    def _answer(self, connection: BoardConnection, message: wire.Message) -> None:
        answer_to = self._answers.get(message["op"], self._operate)
        if connection.role == "operator" and answer_to == self._operate:
            self._hear_all()
        try:
            answer = answer_to(connection, message)
        except ShapechangerError as error:  # Such as a course that there is not: the board lives.
            answer = {"error": str(error)}
        except OSError as error:
            answer = {"errno": error.errno}
        if answer is None:
            return
        if "id" not in message:
            _log.warning("process %d: %s", connection.owner.pid, answer)
        else:
            self.send(connection, {"op": "reply", "id": message["id"], **answer})

    def _hear_all(self) -> None:
        """Answer everything that processes have said until now, and notice who is gone."""
        for connection in self.connections:
            if connection.role == "hardware":
                self._serve(connection)

    def _gone(self, connection: BoardConnection) -> None:
        if self._by_fd.pop(connection.fileno(), None) is None:
            return
        self._epoll.unregister(connection.fileno())
        if connection.role == "hardware":
            self._pins.leave(connection.owner, self._now_ns(), died=not connection.polite)
        connection.close()

    def _stamp(self, message: wire.Message) -> int:
        return self._now_ns() if self._clock == "twin" else int(message["t"])

    def _hello(self, connection: BoardConnection, message: wire.Message) -> wire.Message:
        connection.role = message["role"]
        connection.owner = Owner(connection, message["pid"])
        return {"clock": self._clock, "t": self._now_ns()}

    def _claim(self, connection: BoardConnection, message: wire.Message) -> wire.Message:
        pin, mode = message["pin"], message["mode"]
        holder = self._pins.owner(pin)
        other = None if holder is None else holder.connection
        if isinstance(other, BoardConnection) and other is not connection:
            self._serve(other)  # It may be gone by now.
        t = self._stamp(message)
        pull, level = message["pull"], message["level"]
        level = self._pins.claim(connection.owner, pin, mode, pull, level, t)
        if mode == "input":
            connection.inputs.add(pin)
            level = self._input_levels.get(pin, level)
        else:
            connection.inputs.discard(pin)
        return {"level": level}

    def _pin(self, connection: BoardConnection, message: wire.Message) -> None:
        pin, duty, hz = message["pin"], message["duty"], message["hz"]
        self._pins.drive(connection.owner, pin, duty, hz, self._stamp(message))

    def _pulse(self, connection: BoardConnection, message: wire.Message) -> None:
        pin, us, hz = message["pin"], message["us"], message["hz"]
        self._pins.pulse(connection.owner, pin, us, hz, self._stamp(message))

    def _read(self, connection: BoardConnection, message: wire.Message) -> wire.Message:
        at = message["bus"], message["address"]
        return {"data": self._pins.read_chip(*at, message["register"], message["length"])}

    def _write(self, connection: BoardConnection, message: wire.Message) -> wire.Message:
        self._pins.write_chip(
            connection.owner.pid,
            message["bus"],
            message["address"],
            message["register"],
            message["data"],
            self._stamp(message),
        )
        return {}

    def _bye(self, connection: BoardConnection, message: wire.Message) -> None:
        connection.polite = True
