"""The twin's board, a separate process: pins, chips, ledger, world and time.

It is started before the robot and outlives the robot's processes, like hardware. Its arguments are
a descriptor that its owner has opened, and its `BoardSettings`. It ends on SIGTERM, or when the
process at the other end of the descriptor ends.
"""

from __future__ import annotations

import logging
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Literal, get_origin, get_type_hints

import msgspec

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.guard.running import run_early
from shapechanger.robot.twin.camera import FrontCameraPipe
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.operator import operator_functions
from shapechanger.robot.twin.pin_board import PinBoard
from shapechanger.robot.twin.rpc import BoardConnection, Call, Greeting, Role, Slept
from shapechanger.robot.twin.start import BoardAt, BoardSettings, open_world

START_NS: Final = 1_000_000_000
"""First time of the twin's clock; not 0, which could mean "never"."""

_WORLD_STEP_NS: Final = 10_000_000
_LOOK_FOR_READER_S: Final = 0.05  # Interval of checks for a reader while time stands still.
_LATER: Final = object()  # Result of a function to whose caller the board replies later, or never.
_log = logging.getLogger(__name__)
_decode_call: Callable[[bytes], Call] = msgspec.msgpack.Decoder(Call).decode


class _OwnerGone(Exception):
    """The process at the other end of the owner's descriptor has ended."""


def _served(function: Callable[..., object]) -> Callable[[BoardConnection, msgspec.Raw], object]:
    """Return a function that decodes its arguments, and calls `function` with them."""
    hints = get_type_hints(function)
    hints.pop("return", None)
    takes_caller = hints.pop("caller", None) is not None
    # A `Literal` is decoded as str, because `function` itself refuses others with a suggestion.
    kinds = [str if get_origin(hint) is Literal else hint for hint in hints.values()]
    decode: Any = msgspec.msgpack.Decoder(tuple[*kinds]).decode

    def run(caller: BoardConnection, arguments: msgspec.Raw) -> object:
        given = dict(zip(hints, decode(arguments), strict=True))
        return function(**given, **({"caller": caller} if takes_caller else {}))

    return run


class Board:
    """Executes the calls of clients. Time is CLOCK_MONOTONIC; the world has steps of 10 ms.

    A called function with a parameter `caller` gets the connection. Functions may raise a
    `ShapechangerError`, or an `OSError` with an `errno`. The board writes a byte to `owner_fd` once
    it listens; `owner_fd` is readable once the owner has ended.
    """

    def __init__(self, settings: BoardSettings, owner_fd: int) -> None:
        plan, camera, seed = GuardPlan.from_json(settings.plan), settings.camera, settings.seed
        at = BoardAt(Path(settings.folder))
        parts = {output.part for output in plan.outputs if output.part}
        world = open_world(settings.place, parts, camera, seed)
        # Run slow preparations of the world before a guard in real time waits for it.
        world.put_back()
        world.place(seed)
        self._camera: FrontCameraPipe | None = None
        if camera is not None:
            world.picture()
            self._camera = FrontCameraPipe(
                at.fifo_path,
                camera,
                world,
                self.now_ns(),
                latest_only=settings.clock == "real",
                barcode=not settings.place.opener,
            )
        ledger = at.ledger_path.open("xb", buffering=0)
        wiring = TwinWiring(plan, settings.one_shot_ms)
        self._pins = pins = PinBoard(wiring, world, ledger, seed, self.now_ns, self._camera)
        self._tick_hz = plan.tick_hz
        self._clock: Literal["real", "twin"] = settings.clock
        own = (self.greet, self.leave, self.wait, self.sleep)
        chips = (pins.read_chip, pins.write_chip, pins.read_servos, pins.write_servos)
        of_robot = (pins.claim, pins.drive, pins.pulse, *chips)
        functions = (*own, *of_robot, *operator_functions(pins))
        self._functions = {one.__name__: _served(one) for one in functions}
        # Connections of clients, keyed by descriptor, in the order in which they connected.
        self._connections: dict[int, BoardConnection] = {}
        self._owner_fd = owner_fd
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listening.bind(at.socket_path)
        self._listening.listen()
        os.write(owner_fd, b"r")  # Ready.

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return time.monotonic_ns()

    def run(self) -> None:
        """Serve clients and advance time until an error."""
        run_early()  # Raise the priority, because a busy machine would not delay real hardware.
        step_ns = self.now_ns()
        while True:
            due_ns = step_ns if self._camera is None else min(step_ns, self._camera.next_ns)
            self._serve(max(0, due_ns - self.now_ns()) / 1e9)
            now_ns = self.now_ns()
            if now_ns >= due_ns:
                self._advance(now_ns)
                for connection in self._connections.values():
                    connection.wake(now_ns, always=False)
                step_ns = now_ns + _WORLD_STEP_NS if now_ns >= step_ns else step_ns

    def greet(self, caller: BoardConnection, role: Role, pid: int) -> Greeting:
        """Introduce a client as a process with a role."""
        caller.role, caller.pid = role, pid
        return Greeting(self._clock, self.now_ns())

    def leave(self, caller: BoardConnection) -> None:
        """Announce the orderly end of a process."""
        caller.has_left = True

    def wait(self, caller: BoardConnection, until_ns: int) -> object:
        """Reply once an input of the client has an edge; `until_ns` has no effect in real time."""
        caller.waits = caller.call_id
        caller.wake(self.now_ns(), always=False)
        return _LATER

    def sleep(self, caller: BoardConnection, ns: int) -> object:
        """Refuse, because a board in real time cannot advance its clock."""
        raise RobotError("This board runs in real time, which cannot be advanced.")

    def _serve(self, timeout_s: float | None) -> None:
        poll = select.poll()
        for fd in (self._listening.fileno(), self._owner_fd, *self._connections):
            poll.register(fd, select.POLLIN)
        ready = {fd for fd, _ in poll.poll(None if timeout_s is None else timeout_s * 1e3)}
        if self._owner_fd in ready:
            raise _OwnerGone
        for connection in [one for fd, one in self._connections.items() if fd in ready]:
            self._execute_all(connection)
        # Accept last, so that the end of a process is handled before its successor connects.
        if self._listening.fileno() in ready:
            connected, _ = self._listening.accept()
            self._connections[connected.fileno()] = BoardConnection(connected)

    def _execute_all(self, connection: BoardConnection) -> None:
        if connection.executes or connection.closed:
            return
        connection.executes = True
        try:
            while data := connection.receive():
                self._execute(connection, _decode_call(data))
        except msgspec.MsgspecError as error:
            _log.warning("process %d sends a malformed request: %s", connection.pid, error)
            data = b""
        connection.executes = False
        if data is not None:
            del self._connections[connection.socket.fileno()]
            if connection.role == "hardware":
                connection.t = self.now_ns()
                self._pins.free(connection, not connection.has_left)
            connection.socket.close()

    def _execute(self, connection: BoardConnection, call: Call) -> None:
        try:
            function = self._functions.get(call.function)
            if function is None:
                raise RobotError(f"The board has no function {call.function!r}.")
            # A call of an operator takes effect after all calls that the robot's processes have
            # sent before. Before a claim, the end of the pin's previous owner must be handled.
            if connection.role == "operator" or call.function == "claim":
                for other in [*self._connections.values()]:
                    if other.role == "hardware":
                        self._execute_all(other)
            connection.call_id = call.id
            connection.t = self.now_ns() if self._clock == "twin" else call.t
            result = function(connection, call.arguments)
        except (ShapechangerError, OSError) as refusal:  # The board runs on.
            if call.id is None:
                _log.warning("process %d: %s", connection.pid, refusal)
            number = refusal.errno if isinstance(refusal, OSError) else None
            connection.reply(call.id, error=number or str(refusal))
        else:
            if result is not _LATER:
                connection.reply(call.id, result)

    def _advance(self, now_ns: int) -> None:
        """Advance the world to a time, and take the image that is due."""
        for edge in self._pins.advance(now_ns):
            if (reader := self._pins.reader(edge.pin)) is not None:
                reader.add_edge(edge)
        if self._camera is not None and now_ns >= self._camera.next_ns:
            self._camera.take(now_ns)


class TwinTimeBoard(Board):
    """A board whose time advances only while a client sleeps and all participants wait.

    A client is a participant from its first `wait`. All waits end together: at the next tick of the
    guard, at the end of a sleep, or at the earliest `until_ns`.
    """

    def __init__(self, settings: BoardSettings, owner_fd: int) -> None:
        self._now_ns = START_NS
        self._ticks = 0
        # A tuple for each sleep: its end, ns, its number, the caller, and the id of its call.
        self._sleepers: list[tuple[int, int, BoardConnection, int | None]] = []
        self._sleeps = 0
        self._wanted_ns: dict[BoardConnection, int] = {}  # Each participant's last `until_ns`.
        super().__init__(settings, owner_fd)

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return self._now_ns

    def wait(self, caller: BoardConnection, until_ns: int) -> object:
        """Make a client a participant, which waits for the next event; see the class."""
        self._wanted_ns[caller] = until_ns
        caller.waits = caller.call_id
        return _LATER

    def sleep(self, caller: BoardConnection, ns: int) -> object:
        """Let a client sleep for `ns` nanoseconds, which ends with a `Slept`."""
        self._sleeps += 1
        self._sleepers.append((self._now_ns + ns, self._sleeps, caller, caller.call_id))
        return _LATER

    def run(self) -> None:
        """Serve clients and advance time until an error."""
        camera = self._camera
        while True:
            if self._sleepers:
                self._serve(0.0)
            else:
                found = camera is None or camera.find_reader()
                self._serve(None if found else _LOOK_FOR_READER_S)
            # Clients that have disconnected no longer sleep.
            self._sleepers = [one for one in self._sleepers if not one[2].closed]
            if not self._sleepers:
                continue
            until_ns, _, connection, call_id = first = min(self._sleepers)
            if until_ns > self._now_ns:
                self._step(until_ns)
            if until_ns <= self._now_ns:
                self._sleepers.remove(first)
                newest_ns = None if camera is None else camera.newest_ns
                connection.reply(call_id, Slept(self._now_ns, newest_ns))

    def _step(self, end_ns: int) -> None:
        """Advance to the next image, or to the time at which all waits end, and end them."""
        now_ns = self._now_ns
        while (tick_ns := START_NS + round(self._ticks * 1e9 / self._tick_hz)) <= now_ns:
            self._ticks += 1
        wanted = {one: ns for one, ns in self._wanted_ns.items() if not one.closed}
        self._wanted_ns = wanted
        grant_ns = min(end_ns, tick_ns, *(ns for ns in wanted.values() if ns > now_ns))
        picture_ns = grant_ns if self._camera is None else max(self._camera.next_ns, now_ns)
        self._now_ns = min(grant_ns, picture_ns)
        self._advance(self._now_ns)
        if self._now_ns < grant_ns:
            return
        for connection in wanted:
            connection.wake(self._now_ns, always=True)
        while any(one.waits is None and not one.closed for one in wanted):
            self._serve(None)


if __name__ == "__main__":
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="twin: %(message)s")
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C must stop the robot first.
    given = msgspec.json.decode(sys.argv[2], type=BoardSettings)
    with suppress(_OwnerGone):
        (Board if given.clock == "real" else TwinTimeBoard)(given, int(sys.argv[1])).run()
