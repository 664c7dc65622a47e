"""What lies below the drivers: pins, buses and time, real or a twin's.

The processes of a robot are told by name where their hardware comes from, as MODULE:FUNCTION and
one argument for it. `RealHardware` is the Raspberry Pi; a twin brings its own. So the same drivers
run on both, and nothing of the robot knows a twin.
"""

from __future__ import annotations

import importlib
import select
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, Protocol

from shapechanger.errors import RobotError

if TYPE_CHECKING:  # They need the SDK, and only a rig has it.
    from shapechanger.robot.drivers.dynamixel.protocol import Port
    from shapechanger.robot.drivers.dynamixel.settings import BusSettings

__all__ = [
    "REAL",
    "Clock",
    "Hardware",
    "I2cBus",
    "RealClock",
    "RealHardware",
    "ServoPins",
    "connect",
    "real",
]

REAL: Final = "shapechanger.robot.hardware:real"
"""Where the hardware comes from when nothing else is said."""


class Clock(Protocol):
    """Where a process takes its time from."""

    def now_ns(self) -> int:
        """The time in nanoseconds; it never runs backwards."""
        ...

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait in the guard until there is something to do.

        Args:
            readable: File descriptors; one that can be read is something to do.
            until_ns: Time at which there is something to do in any case.
            at_most_s: Real seconds after which to come back with nothing to do, so that the guard
                can show that it lives while a twin's time stands still.

        Returns:
            Whether there is something to do. A twin's time moves in grants: there is something to
            do at each grant, and only then.
        """
        ...

    async def sleep(self, seconds: float) -> int | None:
        """Let so much time go by in the daemon.

        Returns:
            When the newest picture was taken that has been sent to the camera's driver by the end,
            so that the daemon can wait for it; None where pictures come in their own time.
        """
        ...


class I2cBus(Protocol):
    """The part of `smbus2.SMBus` that the drivers use."""

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Send one byte to a chip that has no registers."""
        ...

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """One register."""
        ...

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Set one register."""
        ...

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Several registers, from one on."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Set several registers, from one on."""
        ...

    def close(self) -> None:
        """Let go of the bus."""
        ...


class ServoPins(Protocol):
    """Servo pulses on pins, as `lgpio.tx_servo` makes them."""

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send pulses of this width on a BCM pin from now on; 0 for none."""
        ...

    def close(self) -> None:
        """End all pulses."""
        ...


class Hardware(Protocol):
    """Pins, buses and time."""

    @property
    def clock(self) -> Clock:
        """Where time comes from."""
        ...

    def pin_factory(self) -> Any:
        """What gpiozero's devices take as `pin_factory`."""
        ...

    def i2c(self, bus: int) -> I2cBus:
        """An I2C bus by its number."""
        ...

    def servo_pins(self) -> ServoPins:
        """Pins that send servo pulses."""
        ...

    def servo_port(self, settings: BusSettings) -> Port:
        """The port of a servo bus."""
        ...

    def close(self) -> None:
        """Let go of everything."""
        ...


class RealClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """Nanoseconds of CLOCK_MONOTONIC, which no change of the date moves."""
        return time.monotonic_ns()

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait until a descriptor can be read or it is `until_ns`; see `Clock.wait`."""
        left_s = min((until_ns - time.monotonic_ns()) / 1e9, at_most_s)
        poll = select.poll()
        for fd in readable:
            poll.register(fd, select.POLLIN)
        ready = poll.poll(max(0.0, left_s * 1e3))
        return bool(ready) or time.monotonic_ns() >= until_ns

    async def sleep(self, seconds: float) -> None:
        """Let so many real seconds go by."""
        import asyncio  # Not in the guard, which has no use for it.

        await asyncio.sleep(seconds)


class RealHardware:
    """The pins and buses of a Raspberry Pi; each library is loaded when it is needed."""

    def __init__(self) -> None:
        self._clock = RealClock()
        self._pin_factory: Any = None

    @property
    def clock(self) -> RealClock:
        """The machine's clock."""
        return self._clock

    def pin_factory(self) -> Any:
        """The factory of gpiozero over lgpio, whatever the environment says.

        Its pins are low as soon as they are told so; see `lgpio_pins`.

        Raises:
            RobotError: If there are none, or they cannot be opened.
        """
        if self._pin_factory is None:
            try:
                from shapechanger.robot.drivers.lgpio_pins import LowAtOnceFactory

                self._pin_factory = LowAtOnceFactory()
            except Exception as error:  # gpiozero's, lgpio's, or that one of them is missing.
                raise RobotError(
                    f"This machine's pins cannot be opened ({str(error) or type(error).__name__}); "
                    "`shapechanger robot serve --twin` needs none."
                ) from error
        return self._pin_factory

    def i2c(self, bus: int) -> I2cBus:
        """A bus over smbus2."""
        from smbus2 import SMBus

        return SMBus(bus)

    def servo_pins(self) -> ServoPins:
        """Pulses over lgpio."""
        from shapechanger.robot.drivers.lgpio_pins import LgpioServoPins

        return LgpioServoPins()

    def servo_port(self, settings: BusSettings) -> Port:
        """A serial port over `dynamixel_sdk`."""
        from shapechanger.robot.drivers.dynamixel.protocol import open_serial_port

        return open_serial_port(settings)

    def close(self) -> None:
        """Let go of the pins."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None


def real(_: str = "") -> RealHardware:
    """The hardware of this machine."""
    return RealHardware()


def connect(source: str, argument: str) -> Hardware:
    """The hardware that MODULE:FUNCTION gives for an argument."""
    module, _, function = source.partition(":")
    return getattr(importlib.import_module(module), function)(argument)
