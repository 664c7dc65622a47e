"""The twin's board, a separate process: pins, chips, ledger, world and time.

It is started before the robot and outlives the robot's processes, as hardware does. It ends on
SIGTERM, or with the process at the other end of its owner's descriptor. Its arguments are that
descriptor and its `BoardSettings`.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.guard.running import run_early
from shapechanger.robot.twin.camera import FrontCameraPipe
from shapechanger.robot.twin.operator import operator_functions
from shapechanger.robot.twin.pin_board import PinBoard
from shapechanger.robot.twin.rpc import LATER, BoardConnection, BoardServer, OwnerGone, Slept
from shapechanger.robot.twin.start import BoardAt, BoardSettings, open_world
from shapechanger.robot.twin.wiring import TwinWiring

START_NS: Final = 1_000_000_000
"""First time of the twin's clock; not 0, which could be taken for "never"."""

_WORLD_STEP_NS: Final = 10_000_000
_LOOK_FOR_READER_S: Final = 0.05
"""Interval of looking for a reader of the images while time stands still."""


def run_board(settings: BoardSettings, owner_fd: int) -> None:
    """Run a board until its owner is gone; write a byte to the owner once it listens."""
    plan, camera, seed = GuardPlan.from_json(settings.plan), settings.camera, settings.seed
    is_real = settings.clock == "real"
    parts = {output.part for output in plan.outputs if output.part}
    world = open_world(settings.place, parts, camera, seed)
    # Let the world prepare what takes a while, before a guard in real time waits for it.
    world.put_back()
    world.place(seed)
    if camera is not None:
        world.picture()
    if is_real:
        run_early()  # Hardware is never late because the machine is busy.
    clock = RealTime() if is_real else TwinTime(plan.tick_hz)
    at = BoardAt(Path(settings.folder))
    pipe = None
    if camera is not None:
        barcode = not settings.place.opener
        pipe = FrontCameraPipe(
            at.fifo_path, camera, world, clock.now_ns(), latest_only=is_real, barcode=barcode
        )
    with (
        at.ledger_path.open("xb", buffering=0) as ledger,
        socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listening,
    ):
        wiring = TwinWiring(plan, settings.one_shot_ms)
        board = PinBoard(wiring, world, ledger, seed, clock.now_ns, pipe)
        functions = [*clock.functions, *board.functions, *operator_functions(board)]
        listening.bind(at.socket_path)
        server = BoardServer(
            listening, owner_fd, settings.clock, clock.now_ns, functions, board.free
        )
        listening.listen()
        os.write(owner_fd, b"r")  # Ready.
        with suppress(OwnerGone):
            clock.run(board, server)


def _advance(board: PinBoard, now_ns: int) -> None:
    """Advance the world to a time, and take the image that is due."""
    for edge in board.advance(now_ns):
        if (reader := board.reader(edge.pin)) is not None:
            reader.add_edges([edge])
    if board.camera is not None and now_ns >= board.camera.next_ns:
        board.camera.take(now_ns)


class RealTime:
    """CLOCK_MONOTONIC; the world advances in steps of 10 ms, and for an image."""

    def __init__(self) -> None:
        self.functions = (self.wait,)

    def wait(self, caller: BoardConnection, until_ns: int) -> object:
        """Reply once the client's inputs have edges."""
        caller.waits = caller.call_id
        caller.wake(self.now_ns(), always=False)
        return LATER

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return time.monotonic_ns()

    def run(self, board: PinBoard, server: BoardServer) -> None:
        """Run a board until its owner is gone."""
        step_ns = self.now_ns()
        while True:
            due_ns = step_ns if board.camera is None else min(step_ns, board.camera.next_ns)
            server.serve(max(0, due_ns - self.now_ns()) / 1e9)
            now_ns = self.now_ns()
            if now_ns >= due_ns:
                _advance(board, now_ns)
                for connection in server.connections.values():
                    connection.wake(now_ns, always=False)
                step_ns = now_ns + _WORLD_STEP_NS if now_ns >= step_ns else step_ns


class _Sleeper(NamedTuple):
    """A client that sleeps, ordered by the end of its sleep and then by arrival."""

    until_ns: int
    number: int
    connection: BoardConnection
    call_id: int | None


class TwinTime:
    """Time that advances only while a client sleeps, and waits for all that take part.

    Args:
        tick_hz: Rate of the grants of time, Hz; a client may ask for further ones in between.
    """

    def __init__(self, tick_hz: float) -> None:
        self._tick_hz = tick_hz
        self._now_ns = START_NS
        self._ticks = 0
        self._sleepers: list[_Sleeper] = []
        self._sleeps = 0
        self._wanted_ns: dict[BoardConnection, int] = {}  # Next grant of each that takes part.
        self.functions = (self.sleep, self.wait)

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return self._now_ns

    def sleep(self, caller: BoardConnection, ns: int) -> object:
        """Let a client sleep for `ns` nanoseconds, which ends with a `Slept`."""
        self._sleeps += 1
        until_ns = self._now_ns + ns
        self._sleepers.append(_Sleeper(until_ns, self._sleeps, caller, caller.call_id))
        return LATER

    def wait(self, caller: BoardConnection, until_ns: int) -> object:
        """Finish the grant of a client, which takes part from now on, until its next is due."""
        self._wanted_ns[caller] = until_ns
        caller.waits = caller.call_id
        return LATER

    def run(self, board: PinBoard, server: BoardServer) -> None:
        """Run a board until its owner is gone."""
        camera = board.camera
        while True:
            if self._sleepers:
                server.serve(0.0)
            else:
                found = camera is None or camera.find_reader()
                server.serve(None if found else _LOOK_FOR_READER_S)
            # Clients that are gone no longer sleep.
            self._sleepers = [one for one in self._sleepers if not one.connection.closed]
            if not self._sleepers:
                continue
            first = min(self._sleepers)
            if first.until_ns > self._now_ns:
                self._step(board, server, first.until_ns)
            if first.until_ns <= self._now_ns:
                self._sleepers.remove(first)
                newest_ns = None if camera is None else camera.newest_ns
                first.connection.reply(first.call_id, Slept(self._now_ns, newest_ns))

    def _step(self, board: PinBoard, server: BoardServer, end_ns: int) -> None:
        """Advance to the next time at which anything happens."""
        now_ns = self._now_ns
        wanted = {one: ns for one, ns in self._wanted_ns.items() if not one.closed}
        self._wanted_ns = wanted
        grant_ns = min(end_ns, self._next_tick_ns(), *(ns for ns in wanted.values() if ns > now_ns))
        camera = board.camera
        picture_ns = grant_ns if camera is None else max(camera.next_ns, now_ns)
        self._now_ns = min(grant_ns, picture_ns)
        _advance(board, self._now_ns)
        if self._now_ns < grant_ns:
            return
        for connection in wanted:
            connection.wake(self._now_ns, always=True)
        while any(one.waits is None and not one.closed for one in wanted):
            server.serve(None)

    def _next_tick_ns(self) -> int:
        while (tick_ns := START_NS + round(self._ticks * 1e9 / self._tick_hz)) <= self._now_ns:
            self._ticks += 1
        return tick_ns


if __name__ == "__main__":
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="twin: %(message)s")
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the robot, which then stops.
    run_board(msgspec.json.decode(sys.argv[2], type=BoardSettings), int(sys.argv[1]))
