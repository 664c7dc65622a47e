"""What an operator can do to the world, and to what is in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from shapechanger.errors import RobotError, UnknownName, WorldError
from shapechanger.twin import wire
from shapechanger.twin.camera import CAMERA_FAULTS, CameraFault, FrontCameraPipe
from shapechanger.twin.ledger import LedgerWriter
from shapechanger.twin.pin_board import PinBoard
from shapechanger.twin.rig import Rig
from shapechanger.twin.sensors import PinSensors
from shapechanger.worlds.world import RESTING_V, World

__all__ = ["Operating"]

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
