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
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Final

from shapechanger.errors import RobotError, UnknownName, WorldError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.priority import run_early
from shapechanger.twin import messages as wire
from shapechanger.twin.camera import CAMERA_FAULTS, CameraFault, FrontCameraPipe
from shapechanger.twin.pin_board import PinBoard, chips_of
from shapechanger.twin.rig import Rig
from shapechanger.twin.sensors import PinSensors, Surroundings
from shapechanger.twin.server import BoardConnection, OwnerGone, Switchboard
from shapechanger.twin.signals import LedgerWriter
from shapechanger.twin.timekeeper import MachineTime, TwinTime
from shapechanger.twin.wiring import TwinWiring
from shapechanger.twin.world.place import Place, open_world
from shapechanger.worlds.world import RESTING_V, World

__all__ = ["Board", "Operating", "main"]

_BUTTONS: Final = ("bumper", "stop")


class Operating:
    """Does what the operator says; see `Operator`.

    Args:
        world: Where the vehicle is.
        sensors: What is on the pins.
        pins: The pins and chips.
        camera: The front camera; None without one.
        ledger: Where it is written down.
        now_ns: The time.
        rig: The servos on a bus; None without any.
    """

    def __init__(
        self,
        world: World,
        sensors: PinSensors,
        pins: PinBoard,
        camera: FrontCameraPipe | None,
        ledger: LedgerWriter,
        now_ns: Callable[[], int],
        rig: Rig | None = None,
    ) -> None:
        self._rig = rig
        self._world = world
        self._sensors = sensors
        self._pins = pins
        self._camera = camera
        self._ledger = ledger
        self._now_ns = now_ns

    def do(self, message: wire.Message) -> wire.Message:
        """Do it, and answer.

        Raises:
            RobotError: If it cannot be done.
        """
        match message["op"]:
            case "place":
                self._world.place(message["seed"])
                self._ledger.write(self._now_ns(), "place", seed=message["seed"])
                return {}
            case "put_back":
                return self._put_back()
            case "course":
                self._world.lay_out(message["seed"])
                self._ledger.write(self._now_ns(), "course", seed=message["seed"])
                return {}
            case "camera":
                return self._break_camera(message["how"])
            case "press":
                return self._press(message["what"], message["down"])
            case "battery":
                volts = message["volts"]
                self._world.resting_v = RESTING_V if volts is None else volts
                return self._noted(f"battery {volts}")
            case "distance":
                self._sensors.say_distance(message["metres"], message["dead"])
                return self._noted(f"distance {'dead' if message['dead'] else message['metres']}")
            case "chip":
                return self._break_chip(message["bus"], message["address"], message["dead"])
            case "servo_fault":
                self._servos().break_servo(message["tendon"], message["how"])
                return self._noted(f"servo {message['tendon']} {message['how'] or 'well'}")
            case "magnet":
                self._pins.encoder(message["joint"]).set_magnet(message["how"])
                return self._noted(f"magnet {message['joint']} {message['how'] or 'well'}")
            case "tensions":
                return {"tensions": self._servos().tensions()}
            case "levels":
                levels = self._pins.levels
                return {
                    "duties": list(levels.duties.items()),
                    "pulses": [[pin, *pulse] for pin, pulse in levels.pulses.items()],
                    "channels": [[*at, *pulse] for at, pulse in levels.channels.items()],
                    "edges_ns": list(levels.edges_ns.items()),
                    "t": self._now_ns(),
                }
            case "where":
                seen = self._world.inputs()
                pose = seen.pose
                return {
                    "x": pose.x,
                    "y": pose.y,
                    "heading": pose.heading,
                    "speed": seen.speed,
                    "travelled_m": seen.travelled_m,
                    "bumped": seen.bumped,
                    "distance_m": self._world.distance_m(),
                    "truth": self._world.truth(),
                    "t": self._now_ns(),
                }
            case op:
                raise RobotError(f"The twin's board does not know what {op!r} is.")

    def _servos(self) -> Rig:
        if self._rig is None:
            raise RobotError("This twin has no servo bus.")
        return self._rig

    def _put_back(self) -> wire.Message:
        try:
            self._world.put_back()
        except WorldError as error:
            raise RobotError(f"The vehicle cannot be put back: {error}") from error
        self._ledger.write(self._now_ns(), "put_back")
        return {}

    def _break_camera(self, how: str) -> wire.Message:
        if self._camera is None:
            raise RobotError("This twin has no camera.")
        faults: dict[str, CameraFault] = {fault: fault for fault in CAMERA_FAULTS}
        if how not in faults:
            raise UnknownName("fault of a camera", how, CAMERA_FAULTS)
        self._camera.fault = faults[how]
        return self._noted(f"camera {how or 'well'}")

    def _press(self, what: str, down: bool) -> wire.Message:
        if what not in _BUTTONS:
            raise UnknownName("button", what, _BUTTONS)
        if what == "stop":
            self._sensors.press_stop(down, self._now_ns())
        else:
            self._sensors.hold_bumpers(down)
        return self._noted(f"{what} {'down' if down else 'up'}")

    def _break_chip(self, bus: int, address: int, dead: bool) -> wire.Message:
        if dead:
            self._pins.dead_chips.add((bus, address))
        else:
            self._pins.dead_chips.discard((bus, address))
        return self._noted(f"chip {bus} {address} {'dead' if dead else 'well'}")

    def _noted(self, what: str) -> wire.Message:
        self._ledger.write(self._now_ns(), "fault", what=what)
        return {}


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
        wiring: TwinWiring,
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

    def _operate(self, connection: BoardConnection, message: wire.Message) -> wire.Message | None:
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
        TwinWiring(plan, given.one_shot_ms),
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
