"""Calls from processes to the board: messages, and both ends of a connection.

A client sends `Call`s and the board replies to them: one MessagePack object per datagram, over a
Unix socket of type `SOCK_SEQPACKET`, which keeps datagrams separate and in order. Arguments are
decoded by the types of the called function. Times are nanoseconds of the twin's clock.
"""

from __future__ import annotations

import os
import select
import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any, Final, Literal, NamedTuple, TypeVar

import msgspec

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.drivers.simulation import Edge

MAX_MESSAGE: Final = 64 * 1024
"""Size of the largest message in bytes."""

Role = Literal["hardware", "operator", "clock"]
"""A robot's process, a person next to the robot, or a connection that only sleeps."""

_GONE: Final = "The twin's board has ended."
_HELD_UP_S: Final = 0.01  # Interval of `while_held_up` while the board does not reply, s.
# Time for which `while_held_up` is called in a transfer, s; then the supervisor sees the silence.
_PATIENCE_S: Final = 10.0
_MAX_EDGES: Final = 500  # Number of edges to queue for a client that does not wait for them.

_Result = TypeVar("_Result")


class Call(msgspec.Struct, frozen=True, omit_defaults=True):
    """A call of a function of the board, with encoded arguments.

    Without an `id`, the client waits for no `Reply`, and the board only logs failures. `t` is the
    time of the call, ns; a board with a twin's clock ignores it and uses its own time.
    """

    function: str
    arguments: msgspec.Raw
    id: int | None = None
    t: int = 0


class Reply(msgspec.Struct, frozen=True, omit_defaults=True):
    """Reply to a call: an encoded result, an error message, or an `errno`."""

    id: int
    result: msgspec.Raw = msgspec.Raw(b"\xc0")  # None.
    error: str | int = ""

    def decode(self, kind: Any) -> Any:
        """Return the result, decoded as the type `kind`, or raise the error of the call."""
        if isinstance(self.error, int):
            raise OSError(self.error, os.strerror(self.error))
        if self.error:
            raise RobotError(self.error)
        return msgspec.msgpack.decode(self.result, type=kind)


class Greeting(NamedTuple):
    """Result of "greet": the kind of clock, and its time, ns."""

    clock: Literal["real", "twin"]
    t: int


class Slept(NamedTuple):
    """Result of "sleep": the time, and the capture time of the newest frame or None, ns."""

    t: int
    captured_ns: int | None


class Awake(NamedTuple):
    """Result of "wait": the time, ns, and the edges of the client's inputs since the last wait."""

    t: int
    edges: list[Edge]


# Settings of chips may have pins of the class `Pin`, a subclass of int.
encode: Callable[[object], bytes] = msgspec.msgpack.Encoder(enc_hook=int).encode


def encode_call(function: str, *arguments: object, id: int | None = None) -> bytes:
    """Return an encoded `Call` with the present time."""
    return encode(Call(function, msgspec.Raw(encode(arguments)), id, time.monotonic_ns()))


def decode_reply(data: bytes) -> Reply:
    """Decode a reply; raise RobotError if `data` is empty, the end of a connection."""
    if not data:
        raise RobotError(_GONE)
    return msgspec.msgpack.decode(data, type=Reply)


def board_gone(_: OSError) -> RobotError:
    """Return the error for a connection that fails."""
    return RobotError(_GONE)


class BoardClient:
    """A connection to the board, to be used by one thread."""

    def __init__(self, path: str, role: Role) -> None:
        self._last_id = 0
        self._waits = 0  # Id of the "wait" without a reply; 0 for none.
        self._replies: dict[int, Reply] = {}
        self._edges: deque[Edge] = deque()
        self.levels: dict[int, int] = {}  # Levels of the pins that are claimed as inputs.
        # Functions that `dispatch` calls with the level and the time of an edge, keyed by pin.
        self.watchers: dict[int, Callable[[int, int], None]] = {}
        # Called every 10 ms, for up to 10 s, while a request cannot be sent or gets no reply.
        self.while_held_up: Callable[[], object] = lambda: None
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ExitStack() as undo:
            undo.callback(self._socket.close)
            with translate_errors(
                OSError,
                to=lambda error: RobotError(
                    f"No twin's board answers at {path}: {error.strerror}."
                ),
            ):
                self._socket.connect(path)
            self._socket.settimeout(_HELD_UP_S)
            self.clock, self.now_ns = self.ask(Greeting, "greet", role, os.getpid())
            undo.pop_all()

    @property
    def closed(self) -> bool:
        """True if `close` was called."""
        return self.fileno() < 0

    def fileno(self) -> int:
        """Return the descriptor of the connection."""
        return self._socket.fileno()

    def post(self, function: str, *arguments: object) -> None:
        """Call a function of the board without waiting for its end."""
        self._send(encode_call(function, *arguments))

    def ask(self, kind: Any, function: str, *arguments: object) -> Any:
        """Call a function of the board and return its result."""
        call_id = self._call(function, *arguments)
        until_s = time.monotonic() + _PATIENCE_S
        while call_id not in self._replies:
            self._receive(until_s)
        return self._replies.pop(call_id).decode(kind)

    def wait(self, until_ns: int = 0, at_most_s: float = 0.0) -> bool:
        """Wait until the board reports edges or, with a twin's clock, ends all waits.

        Return True after a report, which updates `now_ns` and `levels`, or False after `at_most_s`.
        """
        self._waits = self._waits or self._call("wait", until_ns)
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        while self._waits not in self._replies:
            if not poll.poll(max(0.0, at_most_s * 1e3)):
                return False
            self._receive()
        self.now_ns, edges = self._replies.pop(self._waits).decode(Awake)
        self._waits = 0
        self.levels |= {edge.pin: edge.level for edge in edges}
        self._edges.extend(edges)
        return True

    def dispatch(self) -> None:
        """Pass all edges that have arrived to their watchers."""
        while self._edges:
            edge = self._edges.popleft()
            if (watcher := self.watchers.get(edge.pin)) is not None:
                watcher(edge.level, edge.t)

    def close(self) -> None:
        """Disconnect from the board in an orderly way."""
        if not self.closed:
            with suppress(RobotError), self._socket:  # The board may have ended first.
                self.post("leave")

    def _call(self, function: str, *arguments: object) -> int:
        self._last_id += 1
        self._send(encode_call(function, *arguments, id=self._last_id))
        return self._last_id

    def _send(self, data: bytes) -> None:
        self._await(lambda: self._socket.send(data), time.monotonic() + _PATIENCE_S)

    def _receive(self, until_s: float = 0.0) -> None:
        reply = decode_reply(self._await(lambda: self._socket.recv(MAX_MESSAGE), until_s))
        self._replies[reply.id] = reply

    def _await(self, transfer: Callable[[], _Result], until_s: float) -> _Result:
        """Repeat a transfer until it succeeds; a busy machine or a new world may delay it."""
        while True:
            with translate_errors(OSError, to=board_gone), suppress(TimeoutError):
                return transfer()
            if time.monotonic() < until_s:
                self.while_held_up()


class BoardConnection:
    """The board's end of the connection to a client; it never blocks.

    A process with two connections counts as two clients.
    """

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self.socket = connected
        self.role: Role = "clock"
        self.pid = 0  # Process at the other end.
        self.call_id: int | None = None  # Id of the executed call, if it expects a reply.
        self.t = 0  # Time of the executed call, ns.
        self.waits: int | None = None  # Id of a "wait" of the client without a reply, or None.
        self.executes = False  # Whether calls of the client are being executed.
        self.has_left = False  # Whether the client has announced its end.
        self._edges: list[Edge] = []

    @property
    def closed(self) -> bool:
        """True once the client has disconnected."""
        return self.socket.fileno() < 0

    def receive(self) -> bytes | None:
        """Return the next message; b"" if the client has ended, None if no message has arrived."""
        try:
            return self.socket.recv(MAX_MESSAGE)
        except BlockingIOError:
            return None
        except OSError:
            return b""

    def reply(self, call_id: int | None, result: object = None, error: str | int = "") -> None:
        """Send the result or the error of a call; without `call_id`, no client waits for it."""
        if call_id is not None:
            with suppress(OSError):  # If the client has disconnected, `receive` reports it.
                self.socket.send(encode(Reply(call_id, msgspec.Raw(encode(result)), error)))

    def add_edge(self, edge: Edge) -> None:
        """Queue an edge of the client's inputs, in order of time, until the client waits.

        If more than 500 edges are queued, only the last edge of each input is kept. The kernel
        drops unread edges, too.
        """
        self._edges.append(edge)
        if len(self._edges) > _MAX_EDGES:
            self._edges = sorted({edge.pin: edge for edge in self._edges}.values())

    def wake(self, now_ns: int, *, always: bool) -> None:
        """End the client's "wait" if edges are queued, or, if `always`, in any case."""
        if self.waits is not None and (self._edges or always):
            waits, edges = self.waits, self._edges
            self.waits, self._edges = None, []
            self.reply(waits, Awake(now_ns, edges))
