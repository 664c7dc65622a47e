"""Pins and buses of a Raspberry Pi."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from shapechanger.errors import RobotError
from shapechanger.robot.hardware import I2cBus, RealClock, ServoPins

if TYPE_CHECKING:  # Only a rig needs them.
    from shapechanger.robot.drivers.servos.registers import ServoPort
    from shapechanger.robot.drivers.servos.settings import BusSettings


class RealHardware:
    """Pins and buses of a Raspberry Pi; each library is imported when it is needed."""

    def __init__(self) -> None:
        self.clock = RealClock()
        """The machine's clock."""
        self._pin_factory: Any = None

    def pin_factory(self) -> Any:
        """Return gpiozero's factory for lgpio, independent of the environment variables.

        Its pins go low at once; see `lgpio_pins`.

        Raises:
            RobotError: If the pins do not exist or cannot be opened.
        """
        if self._pin_factory is None:
            try:
                from shapechanger.robot.drivers.lgpio_pins import LowAtOnceFactory

                self._pin_factory = LowAtOnceFactory()
            except Exception as error:  # Of gpiozero or lgpio, or one of them is missing.
                raise RobotError(
                    f"Cannot open this machine's pins ({str(error) or type(error).__name__}); "
                    "`shapechanger robot serve --twin` needs none."
                ) from error
        return self._pin_factory

    def i2c(self, bus: int) -> I2cBus:
        """Open a bus with smbus2."""
        from smbus2 import SMBus

        return SMBus(bus)

    def servo_pins(self) -> ServoPins:
        """Open the pins with lgpio."""
        from shapechanger.robot.drivers.lgpio_pins import LgpioServoPins

        return LgpioServoPins()

    def servo_port(self, settings: BusSettings) -> ServoPort:
        """Open a serial port with `dynamixel_sdk`."""
        from shapechanger.robot.drivers.servos.serial_port import open_serial_port

        return open_serial_port(settings)

    def close(self) -> None:
        """Close the pins."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None


def real(_: str = "") -> RealHardware:
    """Return the hardware of this machine."""
    return RealHardware()
