"""A board in this process: the same pins, chips and sensors, without sockets and other processes.

Time is that of the board, and moves only when `LocalBoard.advance` is called.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.settings import BusSettings
from shapechanger.twin import wire
from shapechanger.twin.i2c import TwinBus
from shapechanger.twin.ledger import NoLedger
from shapechanger.twin.pin_board import Owner, PinBoard, chips_of
from shapechanger.twin.rig import Rig
from shapechanger.twin.servo_pins import TwinServoPins
from shapechanger.twin.servos.port import LinePort
from shapechanger.twin.surroundings import Surroundings
from shapechanger.twin.timekeeper import START_NS
from shapechanger.twin.wired import EdgeListener
from shapechanger.twin.wiring import Wiring
from shapechanger.worlds.world import World

__all__ = ["LocalBoard", "LocalClock", "LocalHardware", "LocalLink"]


class LocalLink:
    """The only process at a board, which is this one; see `BoardLink`.

    Args:
        pins: The board's pins and chips.
        input_levels: Levels of the pins that sensors drive, as they are now.
    """

    def __init__(self, pins: PinBoard, input_levels: dict[int, int]) -> None:
        self._pins = pins
        self._input_levels = input_levels
        self._owner = Owner(self, os.getpid())
        self.levels: dict[int, int] = {}
        self.on_edge: EdgeListener | None = None
        self.closed = False

    def post(self, **message: Any) -> None:
        """Change an output."""
        pin, t = message["pin"], message["t"]
        if message["op"] == "pin":
            self._pins.drive(self._owner, pin, message["duty"], message["hz"], t)
        else:
            self._pins.pulse(self._owner, pin, message["us"], message["hz"], t)

    def ask(self, **message: Any) -> wire.Message:
        """Claim a pin, or read and write the registers of a chip."""
        if message["op"] == "claim":
            return {"level": self._claim(message)}
        at = message["bus"], message["address"], message["register"]
        if message["op"] == "read":
            return {"data": self._pins.read_chip(*at, message["length"])}
        self._pins.write_chip(self._owner.pid, *at, message["data"], message["t"])
        return {}

    def drain(self) -> None:
        """Do nothing: edges come by `notice`."""

    def notice(self, pin: int, level: int, at_ns: int) -> None:
        """An input has changed."""
        if pin in self.levels:
            self.levels[pin] = level
            if self.on_edge is not None:
                self.on_edge(pin, level, at_ns)

    def _claim(self, message: wire.Message) -> int:
        pin, mode = message["pin"], message["mode"]
        level = self._pins.claim(
            self._owner, pin, mode, message["pull"], message["level"], message["t"]
        )
        return self._input_levels.get(pin, level) if mode == "input" else level


class LocalClock:
    """The board's time."""

    def __init__(self) -> None:
        self.time_ns = START_NS

    def now_ns(self) -> int:
        """The time in nanoseconds."""
        return self.time_ns

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Nobody can wait here: whoever advances the board would have to wait, too."""
        raise RobotError("The time of a board in one's own process moves only by `advance`.")

    async def sleep(self, seconds: float) -> int | None:
        """Nobody can wait here; see `wait`."""
        raise RobotError("The time of a board in one's own process moves only by `advance`.")


class LocalHardware:
    """Pins, buses and time of a board in this process; see `shapechanger.robot.hardware`."""

    def __init__(self, link: LocalLink, clock: LocalClock, rig: Rig | None = None) -> None:
        self._link = link
        self._clock = clock
        self._rig = rig
        self._pin_factory: Any = None

    @property
    def clock(self) -> LocalClock:
        """The board's time."""
        return self._clock

    def pin_factory(self) -> Any:
        """What gpiozero's devices take as `pin_factory`."""
        if self._pin_factory is None:
            from shapechanger.twin.pins import TwinPinFactory  # gpiozero only where there are pins.

            self._pin_factory = TwinPinFactory(self._link, self._clock)
        return self._pin_factory

    def i2c(self, bus: int) -> TwinBus:
        """An I2C bus by its number."""
        return TwinBus(self._link, self._clock, bus)

    def servo_pins(self) -> TwinServoPins:
        """Pins that send servo pulses."""
        return TwinServoPins(self._link, self._clock)

    def servo_port(self, settings: BusSettings) -> LinePort:
        """The port of the servos.

        Raises:
            RobotError: If the board has none there.
        """
        if self._rig is None:
            raise RobotError(f"There is no {settings.device} at this twin.")
        self._rig.require(settings.device)
        return LinePort(self._rig.line, settings.baud)

    def close(self) -> None:
        """Let go of the pins."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None
        self._link.closed = True


class LocalBoard:
    """A board with a world around it.

    Args:
        wiring: What is attached to its pins.
        world: Where the vehicle is.
        seed: Of the phase of software PWM.

    Attributes:
        pins: Its pins and chips.
        hardware: What a guard in this process drives.
        rig: The servos on a bus; None without any.
    """

    def __init__(self, wiring: Wiring, world: World, seed: int = 0) -> None:
        self._clock = LocalClock()
        self._surroundings = Surroundings(wiring, world, self._clock.time_ns)
        sensors = self._surroundings.sensors
        self.pins = PinBoard(wiring, chips_of(wiring.plan, world), NoLedger(), seed)
        self.pins.on_output = sensors.output_changed
        self._link = LocalLink(self.pins, sensors.levels)
        self.rig = self._surroundings.rig
        self.hardware = LocalHardware(self._link, self._clock, self.rig)

    @property
    def now_ns(self) -> int:
        """The time."""
        return self._clock.time_ns

    def advance(self, now_ns: int) -> None:
        """Let time, the world and the sensors go on."""
        self._clock.time_ns = now_ns
        for edge in self._surroundings.advance(now_ns, self.pins.levels):
            self._link.notice(edge.pin, edge.level, edge.t)
