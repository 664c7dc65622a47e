"""The twin's board, a separate process: pins, chips, ledger, world and time.

It is started before the robot and outlives the robot's processes, as hardware does. It ends on
SIGTERM, or with the process at the other end of its owner's descriptor.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Final, NamedTuple

import msgspec

from shapechanger.contract.plan import GuardPlan
from shapechanger.contract.world import RESTING_V
from shapechanger.errors import RobotError, WorldError
from shapechanger.robot.drivers.hcsr04 import SimulatedHcsr04
from shapechanger.robot.drivers.simulation import Levels
from shapechanger.robot.drivers.switch import SimulatedSwitch
from shapechanger.robot.guard.priority import run_early
from shapechanger.robot.twin.camera import FrontCameraPipe
from shapechanger.robot.twin.messages import Grant, Slept, Whereabouts
from shapechanger.robot.twin.pin_board import PinBoard
from shapechanger.robot.twin.place import open_world
from shapechanger.robot.twin.server import (
    LATER,
    START_NS,
    BoardConnection,
    BoardServer,
    OwnerGone,
    functions_of,
)
from shapechanger.robot.twin.signals import LedgerWriter
from shapechanger.robot.twin.start import BoardAt, BoardSettings
from shapechanger.robot.twin.wiring import TwinWiring

_WORLD_STEP_NS: Final = 10_000_000
_LOOK_FOR_READER_S: Final = 0.05
"""Interval of looking for a reader of the pictures while time stands still."""

_log = logging.getLogger(__name__)


class Board:
    """Pins, chips, sensors and world, with a server for clients.

    Attributes:
        world: World of the robot.
        camera: Front camera; None without one.
        server: Server of the clients.
    """

    def __init__(self, settings: BoardSettings, owner_fd: int) -> None:
        plan, camera, seed = GuardPlan.from_json(settings.plan), settings.camera, settings.seed
        is_real = settings.clock == "real"
        parts = {output.part for output in plan.outputs if output.part}
        self.world = open_world(settings.place, parts, camera, seed)
        # Let the world prepare what takes a while, before a guard in real time waits for it.
        self.world.put_back()
        self.world.place(seed)
        if camera is not None:
            self.world.picture()
        if is_real:
            run_early()  # Hardware is never late because the machine is busy.
        clock = RealTime() if is_real else TwinTime(plan.tick_hz)
        self._time = clock
        files = BoardAt(Path(settings.folder))
        self.camera: FrontCameraPipe | None = None
        if camera is not None:
            self.camera = FrontCameraPipe(
                str(files.fifo_path),
                camera.fps,
                camera.jpeg_quality,
                latest_only=is_real,
                start_ns=clock.now_ns(),
                seed=seed,
                barcode=not settings.place.opener,
            )
        listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        listening.bind(files.socket_path)
        self._ledger = LedgerWriter(files.ledger_path)
        wiring = TwinWiring(plan, settings.one_shot_ms)
        self._pins = PinBoard(wiring, self.world, self._ledger, seed, clock.now_ns())
        functions = functions_of("time", (clock.wait, clock.sleep))
        operator = _OperatorFunctions(self, self._pins, clock.now_ns)
        functions |= functions_of("operator", operator.all())
        self.server = BoardServer(
            listening, owner_fd, self._pins, settings.clock, clock.now_ns, functions
        )
        listening.listen()

    def run(self) -> None:
        """Run until the owner is gone."""
        try:
            self._time.run(self)
        except OwnerGone:
            _log.debug("the owner is gone, so this board ends")
        finally:
            self.server.close()
            self._ledger.close()
            if self.camera is not None:
                self.camera.close()

    def advance(self, now_ns: int) -> None:
        """Advance the world to a time, and send the edges of inputs on the way."""
        edges = self._pins.advance(now_ns)
        for edge in edges:
            self._ledger.write(edge.t, "input", pin=edge.pin, level=edge.level)
        self.server.send_edges(edges)

    def record(self, kind: str, **fields: object) -> None:
        """Write a line of the ledger."""
        self._ledger.write(self._time.now_ns(), kind, **fields)


class _OperatorFunctions:
    """What a person next to the robot does, and the truth; see `Operator`."""

    def __init__(self, board: Board, pins: PinBoard, now_ns: Callable[[], int]) -> None:
        self._board = board
        self._world = board.world
        self._pins = pins
        self._now_ns = now_ns

    def all(self) -> list[Callable[..., object]]:
        names = [name for name in vars(type(self)) if not name.startswith("_") and name != "all"]
        return [getattr(self, name) for name in names]

    def tensions(self) -> dict[str, float]:
        return self._pins.require_rig().tensions()

    def levels(self) -> Levels:
        return self._pins.levels

    def where(self) -> Whereabouts:
        seen = self._world.inputs()
        return Whereabouts(
            x=seen.pose.x,
            y=seen.pose.y,
            heading=seen.pose.heading,
            speed=seen.speed,
            travelled_m=seen.travelled_m,
            bumped=seen.bumped,
            distance_m=self._world.distance_m(),
            truth=self._world.truth(),
            t=self._now_ns(),
        )

    def place(self, seed: int) -> None:
        self._world.place(seed)
        self._board.record("place", seed=seed)

    def put_back(self) -> None:
        try:
            self._world.put_back()
        except WorldError as error:
            raise RobotError(f"The vehicle cannot be put back: {error}") from error
        self._board.record("put_back")

    def lay_out(self, seed: int) -> None:
        self._world.lay_out(seed)
        self._board.record("course", seed=seed)

    def break_camera(self, fault: str) -> None:
        if self._board.camera is None:
            raise RobotError("This twin has no camera.")
        self._board.camera.break_down(fault)
        self._broke(f"camera {fault or 'well'}")

    def press_bumper(self, down: bool) -> None:
        for bumper in self._pins.sensors.of_kind(SimulatedSwitch):
            bumper.held = down
        self._broke(f"bumper {'down' if down else 'up'}")

    def press_stop(self, down: bool) -> None:
        self._pins.sensors.press_stop(down)
        self._broke(f"stop {'down' if down else 'up'}")

    def set_battery(self, volts: float | None) -> None:
        self._world.resting_v = RESTING_V if volts is None else volts
        self._broke(f"battery {volts}")

    def set_distance(self, metres: float | None, dead: bool) -> None:
        for sensor in self._pins.sensors.of_kind(SimulatedHcsr04):
            sensor.override_m, sensor.dead = metres, dead
        self._broke(f"distance {'dead' if dead else metres}")

    def break_chip(self, bus: int, address: int, dead: bool) -> None:
        chips = self._pins.dead_chips
        (chips.add if dead else chips.discard)((bus, address))
        self._broke(f"chip {bus} {address} {'dead' if dead else 'well'}")

    def break_servo(self, tendon: str, fault: str) -> None:
        self._pins.require_rig().break_servo(tendon, fault)
        self._broke(f"servo {tendon} {fault or 'well'}")

    def break_magnet(self, joint: str, state: str) -> None:
        self._pins.encoder(joint).set_magnet(state)
        self._broke(f"magnet {joint} {state or 'well'}")

    def _broke(self, action: str) -> None:
        self._board.record("fault", what=action)


class RealTime:
    """CLOCK_MONOTONIC; the world advances in steps of 10 ms."""

    def wait(self, connection: BoardConnection, call_id: int, until_ns: int) -> object:
        """Refuse: real time cannot be advanced."""
        raise RobotError("This board runs in real time, which cannot be advanced.")

    def sleep(self, connection: BoardConnection, call_id: int, ns: int) -> object:
        """Refuse: real time cannot be advanced."""
        raise RobotError("This board runs in real time, which cannot be advanced.")

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return time.monotonic_ns()

    def run(self, board: Board) -> None:
        """Run a board until its owner is gone."""
        camera = board.camera
        step_ns = self.now_ns()
        while True:
            due_ns = step_ns if camera is None else min(step_ns, camera.next_ns)
            board.server.serve(max(0, due_ns - self.now_ns()) / 1e9)
            now_ns = self.now_ns()
            if now_ns >= due_ns:
                board.advance(now_ns)
                step_ns = now_ns + _WORLD_STEP_NS if now_ns >= step_ns else step_ns
                if camera is not None and now_ns >= camera.next_ns:
                    camera.take(board.world, now_ns)


class _Sleeper(NamedTuple):
    """A client that sleeps, ordered by the end of its sleep and then by arrival."""

    until_ns: int
    number: int
    connection: BoardConnection
    call_id: int


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

    def now_ns(self) -> int:
        """Return the time in nanoseconds."""
        return self._now_ns

    def sleep(self, connection: BoardConnection, call_id: int, ns: int) -> object:
        """Let a client sleep for `ns` nanoseconds, which ends with a `Slept`."""
        self._sleeps += 1
        self._sleepers.append(_Sleeper(self._now_ns + ns, self._sleeps, connection, call_id))
        return LATER

    def wait(self, connection: BoardConnection, call_id: int, until_ns: int) -> object:
        """Finish the grant of a client, which takes part from now on, until its next is due."""
        connection.takes_part = True
        connection.works = False
        connection.until_ns = until_ns
        return LATER

    def run(self, board: Board) -> None:
        """Run a board until its owner is gone."""
        server, camera = board.server, board.camera
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
                self._step(board, first.until_ns)
            if first.until_ns <= self._now_ns:
                self._sleepers.remove(first)
                newest_ns = None if camera is None else camera.newest_ns
                result = Slept(self._now_ns, newest_ns)
                server.reply(first.connection, first.call_id, result)

    def _step(self, board: Board, end_ns: int) -> None:
        """Advance to the next time at which anything happens."""
        server, camera = board.server, board.camera
        participants = [one for one in server.connections if one.takes_part]
        wanted = [one.until_ns for one in participants if one.until_ns > self._now_ns]
        grant_ns = min(end_ns, self._next_tick_ns(), *wanted)
        picture_ns = grant_ns if camera is None else max(camera.next_ns, self._now_ns)
        self._now_ns = min(grant_ns, picture_ns)
        board.advance(self._now_ns)
        if camera is not None and camera.next_ns <= self._now_ns:
            camera.take(board.world, self._now_ns)
        if self._now_ns < grant_ns:
            return
        for connection in participants:
            connection.works = True
            server.send(connection, Grant(self._now_ns))
        while any(one.works and one.fileno() >= 0 for one in participants):
            server.serve(None)

    def _next_tick_ns(self) -> int:
        while (tick_ns := START_NS + round(self._ticks * 1e9 / self._tick_hz)) <= self._now_ns:
            self._ticks += 1
        return tick_ns


def _end(number: int, frame: FrameType | None) -> None:
    sys.exit(0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a board; the arguments are the descriptors of its `BoardSettings` and of its owner."""
    settings_fd, owner_fd = map(int, sys.argv[1:] if arguments is None else arguments)
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="twin: %(message)s")
    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the robot, which then stops.
    with os.fdopen(settings_fd, "rb") as file:
        settings = msgspec.json.decode(file.read(), type=BoardSettings)
    board = Board(settings, owner_fd)
    os.write(owner_fd, b"r")  # Ready.
    board.run()


if __name__ == "__main__":
    main()
