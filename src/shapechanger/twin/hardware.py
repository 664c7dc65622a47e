"""The twin's hardware, for the processes of a robot: pins, buses and time from its board."""

from __future__ import annotations

from typing import Any

from shapechanger.robot.drivers.dynamixel.settings import BusSettings
from shapechanger.twin.board_port import BoardPort
from shapechanger.twin.clock import GrantedClock, SteadyClock
from shapechanger.twin.i2c import TwinBus
from shapechanger.twin.link import Link
from shapechanger.twin.servo_pins import TwinServoPins

__all__ = ["TwinHardware", "connect"]


class TwinHardware:
    """Pins, buses and time from a board.

    Args:
        path: The socket at which the board listens.
    """

    def __init__(self, path: str) -> None:
        self._link = Link(path, "hardware")
        self._clock: GrantedClock | SteadyClock = (
            GrantedClock(self._link, path)
            if self._link.clock == "twin"
            else SteadyClock(self._link)
        )
        self._pin_factory: Any = None

    @property
    def clock(self) -> GrantedClock | SteadyClock:
        """The board's clock, or the machine's, as the board was started."""
        return self._clock

    def pin_factory(self) -> Any:
        """What gpiozero's devices take as `pin_factory`."""
        if self._pin_factory is None:
            from shapechanger.twin.pins import TwinPinFactory  # The daemon needs no gpiozero.

            self._pin_factory = TwinPinFactory(self._link, self._clock)
        return self._pin_factory

    def i2c(self, bus: int) -> TwinBus:
        """An I2C bus by its number."""
        return TwinBus(self._link, self._clock, bus)

    def servo_pins(self) -> TwinServoPins:
        """Pins that send servo pulses."""
        return TwinServoPins(self._link, self._clock)

    def servo_port(self, settings: BusSettings) -> BoardPort:
        """The port of the servos.

        Raises:
            RobotError: If the board has none there.
        """
        return BoardPort(self._link, self._clock, settings)

    def close(self) -> None:
        """Let go of the pins and say goodbye to the board."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None
        if isinstance(self._clock, GrantedClock):
            self._clock.close()
        self._link.close()


def connect(path: str) -> TwinHardware:
    """The hardware of the board that listens at this path.

    Raises:
        RobotError: If no board answers there.
    """
    return TwinHardware(path)
