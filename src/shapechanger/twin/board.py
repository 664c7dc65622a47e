"""The twin's board, a process of its own: pins, chips, ledger, world and time.

It is started before the robot and outlives the robot's processes, as hardware does. It ends on
SIGTERM, or when whoever holds the other end of `--owner-fd` has ended.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import socket
import sys
from collections.abc import Sequence
from types import FrameType

from shapechanger.errors import RobotError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.priority import run_early
from shapechanger.twin import wire
from shapechanger.twin.camera import FrontCameraPipe
from shapechanger.twin.connection import Connection
from shapechanger.twin.ledger import LedgerWriter
from shapechanger.twin.operating import Operating
from shapechanger.twin.pin_board import PinBoard, chips_of
from shapechanger.twin.place import Place, open_world
from shapechanger.twin.surroundings import Surroundings
from shapechanger.twin.switchboard import OwnerGone, Switchboard
from shapechanger.twin.timekeeper import MachineTime, TwinTime
from shapechanger.twin.wiring import Wiring
from shapechanger.worlds.world import World

__all__ = ["Board", "main"]

_log = logging.getLogger(__name__)


class Board:
    """All parts of the board, put together.

    Args:
        wiring: What is attached.
        world: Where the vehicle is.
        time: Who moves time.
        ledger: Where changes go.
        camera: The front camera; None without one.
        listening: The socket for clients.
        owner_fd: Descriptor whose end ends the board; None for none.
        seed: Of everything that is random.
    """

    def __init__(
        self,
        wiring: Wiring,
        world: World,
        time: MachineTime | TwinTime,
        ledger: LedgerWriter,
        camera: FrontCameraPipe | None,
        listening: socket.socket,
        owner_fd: int | None,
        seed: int,
    ) -> None:
        self._world = world
        self._time = time
        self._ledger = ledger
        self._camera = camera
        self._surroundings = Surroundings(wiring, world, time.now_ns())
        sensors = self._surroundings.sensors
        self._pins = PinBoard(wiring, chips_of(wiring.plan, world), ledger, seed)
        self._pins.on_output = sensors.output_changed
        rig = self._surroundings.rig
        self._operating = Operating(world, sensors, self._pins, camera, ledger, time.now_ns, rig)
        self._switchboard = Switchboard(
            listening, owner_fd, self._pins, sensors.levels, time.clock, time.now_ns, self._operate
        )

    def run(self) -> None:
        """Run until the owner is gone."""
        try:
            self._time.run(self._switchboard, self._camera, self._go_on, self._take_picture)
        except OwnerGone:
            _log.info("the owner is gone, so this board ends")
        finally:
            self._switchboard.close()
            self._ledger.close()
            if self._camera is not None:
                self._camera.close()

    def _go_on(self, now_ns: int) -> None:
        edges = self._surroundings.advance(now_ns, self._pins.levels)
        for edge in edges:
            self._ledger.write(edge.t, "input", pin=edge.pin, level=edge.level)
        self._switchboard.tell_edges(edges)

    def _take_picture(self, now_ns: int) -> None:
        if self._camera is not None:
            self._camera.take(self._world, now_ns)

    def _operate(self, connection: Connection, message: wire.Message) -> wire.Message | None:
        if message["op"] == "servo":
            return self._speak_to_servos(message)
        if message["op"] == "wait":
            self._time.wait(connection, message["until"])
            return None
        if message["op"] == "sleep":
            self._time.sleep(connection, message["id"], message["ns"])
            return None
        return self._operating.do(message)

    def _speak_to_servos(self, message: wire.Message) -> wire.Message:
        """Hand bytes to the servo bus, and back what has come."""
        rig = self._surroundings.rig
        if rig is None:
            raise RobotError("This twin has no servo bus.")
        rig.require(message["device"])
        if message["data"]:
            rig.line.receive(bytes.fromhex(message["data"]))
        return {"data": rig.line.send().hex()}


def _warm_up(world: World, seed: int, *, pictures: bool) -> None:
    """Let a world open and plan what takes a while, before a guard in real time waits for it."""
    world.put_back()
    world.place(seed)
    if pictures:
        world.picture()


def _end(number: int, frame: FrameType | None) -> None:
    sys.exit(0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a board as the command line says."""
    parser = argparse.ArgumentParser(description="The simulated board of a robot.")
    parser.add_argument("--plan-fd", type=int, required=True, help="descriptor of the GuardPlan")
    parser.add_argument("--socket", required=True, help="where to listen")
    parser.add_argument("--ledger", required=True, help="file to write")
    parser.add_argument("--clock", choices=("real", "twin"), required=True)
    parser.add_argument("--owner-fd", type=int, help="descriptor whose end ends this process")
    parser.add_argument("--fifo", help="where pictures go")
    parser.add_argument("--size", default="160x120", help="of the pictures")
    parser.add_argument("--fps", type=float, default=20.0)
    parser.add_argument("--quality", type=int, default=80)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--world", default="", help="kind of place; none for the plain room")
    parser.add_argument("--vehicle", default="", help="what drives there, such as car")
    parser.add_argument("--lens", action="append", default=[], help="what is wrong with the camera")
    parser.add_argument("--finger", default="", help="parameters of a finger, as JSON")
    parser.add_argument("--one-shot-ms", type=float, help="of the enable line; none without it")
    given = parser.parse_args(arguments)

    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="twin: %(message)s")
    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the robot, which then stops.
    with os.fdopen(given.plan_fd, encoding="utf-8") as file:
        plan = GuardPlan.from_json(file.read())

    width, height = (int(number) for number in given.size.split("x"))
    parts = {output.part for output in plan.outputs if output.part}
    size = (width, height) if given.fifo is not None else None
    place = Place(given.world, given.vehicle, tuple(given.lens), given.finger)
    world = open_world(place, parts, size, given.seed)
    _warm_up(world, given.seed, pictures=size is not None)
    if given.clock == "real":
        run_early()  # It stands for hardware, which is never late because a machine is busy.
    time = TwinTime(plan.tick_hz) if given.clock == "twin" else MachineTime()
    camera = None
    if given.fifo is not None:
        camera = FrontCameraPipe(
            given.fifo,
            given.fps,
            given.quality,
            latest_only=given.clock == "real",
            start_ns=time.now_ns(),
            seed=given.seed,
            barcode=not given.world,
        )
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listening.bind(given.socket)
    board = Board(
        Wiring(plan, given.one_shot_ms),
        world,
        time,
        LedgerWriter(given.ledger),
        camera,
        listening,
        given.owner_fd,
        given.seed,
    )
    listening.listen()
    if given.owner_fd is not None:
        os.write(given.owner_fd, b"r")  # Ready.
    board.run()


if __name__ == "__main__":
    main()
