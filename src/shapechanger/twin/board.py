"""The twin's board, a process of its own: pins, chips, ledger, world and time.

It is started before the robot and outlives the robot's processes, as hardware does. It ends on
SIGTERM, or with the process at the other end of its owner's descriptor.
"""

from __future__ import annotations

import logging
import os
import signal
import socket
import sys
from collections.abc import Sequence
from types import FrameType
from typing import Final

import msgspec

from shapechanger.errors import RobotError, UnknownName, WorldError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.priority import run_early
from shapechanger.twin.camera import CAMERA_FAULTS, CameraFault, FrontCameraPipe
from shapechanger.twin.chips import chips_of
from shapechanger.twin.messages import (
    BreakCamera,
    BreakChip,
    BreakMagnet,
    BreakServo,
    ExchangeServoBytes,
    LayOutCourse,
    PlaceVehicle,
    PressButton,
    PutVehicleBack,
    ReadLevels,
    ReadTensions,
    ReadWhereabouts,
    Request,
    SetBattery,
    SetDistance,
    SleepOnBoard,
    WaitForGrant,
    Whereabouts,
)
from shapechanger.twin.pin_board import PinBoard
from shapechanger.twin.sensors import Surroundings
from shapechanger.twin.server import (
    LATER,
    BoardConnection,
    BoardServer,
    OwnerGone,
    RealTime,
    TwinTime,
)
from shapechanger.twin.servos.rig import Rig
from shapechanger.twin.signals import LedgerWriter
from shapechanger.twin.start import BoardSettings
from shapechanger.twin.wiring import TwinWiring
from shapechanger.twin.world.place import open_world
from shapechanger.worlds.world import RESTING_V, World

__all__ = ["Board", "main"]

_BUTTONS: Final = ("bumper", "stop")

_log = logging.getLogger(__name__)


class Board:
    """Pins, chips, sensors and world, with a server for clients.

    Args:
        wiring: What is attached to the pins.
        world: World of the vehicle.
        time: Time of the board.
        ledger: Record of all changes.
        camera: Front camera; None without one.
        listening: Listening socket for clients.
        owner_fd: Descriptor whose end ends the board.
        seed: Seed of everything random.
    """

    def __init__(
        self,
        wiring: TwinWiring,
        world: World,
        time: RealTime | TwinTime,
        ledger: LedgerWriter,
        camera: FrontCameraPipe | None,
        listening: socket.socket,
        owner_fd: int,
        seed: int,
    ) -> None:
        self._world = world
        self._time = time
        self._ledger = ledger
        self._camera = camera
        self._surroundings = Surroundings(wiring, world, time.now_ns())
        self._sensors = self._surroundings.sensors
        self._pins = PinBoard(wiring, chips_of(wiring.plan, world), ledger, seed)
        self._pins.on_output = self._sensors.output_changed
        self._server = BoardServer(
            listening,
            owner_fd,
            self._pins,
            self._sensors.levels,
            time.clock,
            time.now_ns,
            self._operate,
        )

    def run(self) -> None:
        """Run until the owner is gone."""
        try:
            self._time.run(self._server, self._camera, self._advance, self._take_picture)
        except OwnerGone:
            _log.info("the owner is gone, so this board ends")
        finally:
            self._server.close()
            self._ledger.close()
            if self._camera is not None:
                self._camera.close()

    def _advance(self, now_ns: int) -> None:
        edges = self._surroundings.advance(now_ns, self._pins.levels)
        for edge in edges:
            self._ledger.write(edge.t, "input", pin=edge.pin, level=edge.level)
        self._server.send_edges(edges)

    def _take_picture(self, now_ns: int) -> None:
        if self._camera is not None:
            self._camera.take(self._world, now_ns)

    def _operate(self, connection: BoardConnection, request: Request) -> object:
        """Execute a request about time, servos or the world."""
        match request:
            case WaitForGrant():
                self._time.wait(connection, request.until_ns)
                return LATER
            case SleepOnBoard():
                self._time.sleep(connection, request.id or 0, request.ns)
                return LATER
            case ExchangeServoBytes():
                rig = self._rig()
                rig.require(request.device)
                if request.data:
                    rig.bus.receive(request.data)
                return rig.bus.send()
            case ReadTensions():
                return self._rig().tensions()
            case ReadLevels():
                return self._pins.levels
            case ReadWhereabouts():
                return self._whereabouts()
            case PlaceVehicle():
                self._world.place(request.seed)
                self._ledger.write(self._time.now_ns(), "place", seed=request.seed)
            case PutVehicleBack():
                try:
                    self._world.put_back()
                except WorldError as error:
                    raise RobotError(f"The vehicle cannot be put back: {error}") from error
                self._ledger.write(self._time.now_ns(), "put_back")
            case LayOutCourse():
                self._world.lay_out(request.seed)
                self._ledger.write(self._time.now_ns(), "course", seed=request.seed)
            case _:
                self._ledger.write(self._time.now_ns(), "fault", what=self._fail(request))
        return None

    def _fail(self, request: Request) -> str:
        """Break, repair or press something, and describe it for the ledger."""
        match request:
            case BreakCamera():
                self._break_camera(request.fault)
                return f"camera {request.fault or 'well'}"
            case PressButton():
                self._press(request.button, request.down)
                return f"{request.button} {'down' if request.down else 'up'}"
            case SetBattery():
                self._world.resting_v = RESTING_V if request.volts is None else request.volts
                return f"battery {request.volts}"
            case SetDistance():
                self._sensors.override_distance(request.metres, dead=request.dead)
                return f"distance {'dead' if request.dead else request.metres}"
            case BreakChip():
                at = request.bus, request.address
                (self._pins.dead_chips.add if request.dead else self._pins.dead_chips.discard)(at)
                return f"chip {at[0]} {at[1]} {'dead' if request.dead else 'well'}"
            case BreakServo():
                self._rig().break_servo(request.tendon, request.fault)
                return f"servo {request.tendon} {request.fault or 'well'}"
            case BreakMagnet():
                self._pins.encoder(request.joint).set_magnet(request.fault)
                return f"magnet {request.joint} {request.fault or 'well'}"
            case _:
                raise RobotError(f"The board does not execute {type(request).__name__}.")

    def _rig(self) -> Rig:
        if self._surroundings.rig is None:
            raise RobotError("This twin has no servo bus.")
        return self._surroundings.rig

    def _whereabouts(self) -> Whereabouts:
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
            t=self._time.now_ns(),
        )

    def _break_camera(self, fault: str) -> None:
        if self._camera is None:
            raise RobotError("This twin has no camera.")
        faults: dict[str, CameraFault] = {known: known for known in CAMERA_FAULTS}
        if fault not in faults:
            raise UnknownName("fault of a camera", fault, CAMERA_FAULTS)
        self._camera.fault = faults[fault]

    def _press(self, button: str, down: bool) -> None:
        if button not in _BUTTONS:
            raise UnknownName("button", button, _BUTTONS)
        if button == "stop":
            self._sensors.press_stop(down, self._time.now_ns())
        else:
            self._sensors.hold_bumpers(down)


def _warm_up(world: World, seed: int, *, pictures: bool) -> None:
    """Let the world prepare what takes a while, before a guard in real time waits for it."""
    world.put_back()
    world.place(seed)
    if pictures:
        world.picture()


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
    plan = GuardPlan.from_json(settings.plan)

    parts = {output.part for output in plan.outputs if output.part}
    plan_of_camera = settings.camera
    size = None if plan_of_camera is None else plan_of_camera.size
    world = open_world(settings.place, parts, size, settings.seed)
    _warm_up(world, settings.seed, pictures=size is not None)
    if settings.clock == "real":
        run_early()  # Hardware is never late because the machine is busy.
    time = TwinTime(plan.tick_hz) if settings.clock == "twin" else RealTime()
    camera = None
    if plan_of_camera is not None:
        camera = FrontCameraPipe(
            settings.fifo,
            plan_of_camera.fps,
            plan_of_camera.jpeg_quality,
            latest_only=settings.clock == "real",
            start_ns=time.now_ns(),
            seed=settings.seed,
            barcode=not settings.place.world,
        )
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listening.bind(settings.socket)
    board = Board(
        TwinWiring(plan, settings.one_shot_ms),
        world,
        time,
        LedgerWriter(settings.ledger),
        camera,
        listening,
        owner_fd,
        settings.seed,
    )
    listening.listen()
    os.write(owner_fd, b"r")  # Ready.
    board.run()


if __name__ == "__main__":
    main()
