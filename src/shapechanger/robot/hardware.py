"""Hardware below the drivers: pins, buses and clocks, real or of a twin.

The processes of a robot get the source of their hardware as MODULE:FUNCTION and one argument.
`raspberry_pi` has the real ones, and a twin has its own, so the same drivers run on both, and no
code of the robot depends on a twin.
"""

from __future__ import annotations

import importlib
import select
import time
from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol

REAL: Final = "shapechanger.robot.raspberry_pi:real"
"""Default source of the hardware."""


class Clock(Protocol):
    """Clock of a process."""

    def now_ns(self) -> int:
        """Return the monotonic time, ns."""
        ...

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait in the guard for a readable descriptor or a time.

        Args:
            readable: File descriptors.
            until_ns: The time, ns.
            at_most_s: Limit in real time, s, so that the guard can send heartbeats while a twin's
                time stands still.

        Returns:
            False if only the limit was reached. A twin's time moves in grants: the result is True
            at each grant, and only then.
        """
        ...

    def keep_alive(self, beat: Callable[[], object]) -> None:
        """Let a call to the hardware send heartbeats while a twin's board is held up.

        A busy machine, or a world that is laid out, holds up a board as no hardware is. On a robot
        this does nothing: a guard that hangs in a bus is silent, and must be replaced.

        Args:
            beat: Sends a heartbeat if one is due.
        """
        ...

    async def sleep(self, seconds: float) -> int | None:
        """Let `seconds` pass in the daemon.

        Returns:
            Capture time of the newest frame that the camera's driver was sent by the end, ns, so
            that the daemon can wait for it; None where frames arrive in their own time.
        """
        ...


class I2cBus(Protocol):
    """Methods of `smbus2.SMBus` that the drivers use.

    In all of them, `i2c_addr` is the address of the chip and `register` the number of its (first)
    register; a `value` is one byte, and a `length` a number of bytes.
    """

    def write_byte(self, i2c_addr: int, value: int) -> None:
        """Send one byte to a chip without registers."""
        ...

    def read_byte_data(self, i2c_addr: int, register: int) -> int:
        """Read one register."""
        ...

    def write_byte_data(self, i2c_addr: int, register: int, value: int) -> None:
        """Write one register."""
        ...

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        """Read consecutive registers."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        """Write consecutive registers, one byte each."""
        ...

    def close(self) -> None:
        """Close the bus."""
        ...


class ServoPins(Protocol):
    """Servo pulses on pins, as of `lgpio.tx_servo`."""

    def pulse(self, pin: int, width_us: int, frequency_hz: int) -> None:
        """Send pulses on a pin.

        Args:
            pin: BCM number.
            width_us: Width of a pulse, us; 0 ends them.
            frequency_hz: Pulses per second.
        """
        ...

    def close(self) -> None:
        """End all pulses."""
        ...


class Hardware(Protocol):
    """Pins, buses and clock."""

    @property
    def clock(self) -> Clock:
        """Clock of this process."""
        ...

    def pin_factory(self) -> Any:
        """Return the `pin_factory` for gpiozero's devices."""
        ...

    def i2c(self, bus: int) -> I2cBus:
        """Open the I2C bus of a number."""
        ...

    def servo_pins(self) -> ServoPins:
        """Open the pins that send servo pulses."""
        ...

    def servo_port(self, settings: Any) -> Any:
        """Open the port of a servo bus: a `ServoPort` for `BusSettings`, of `drivers.servos`."""
        ...

    def close(self) -> None:
        """Close all of it."""
        ...


class RealClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """Return the time of CLOCK_MONOTONIC, ns."""
        return time.monotonic_ns()

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait for a readable descriptor or a time; see `Clock.wait`."""
        left_s = min((until_ns - time.monotonic_ns()) / 1e9, at_most_s)
        poll = select.poll()
        for fd in readable:
            poll.register(fd, select.POLLIN)
        ready = poll.poll(max(0.0, left_s * 1e3))
        return bool(ready) or time.monotonic_ns() >= until_ns

    def keep_alive(self, beat: Callable[[], object]) -> None:
        """Do nothing; see `Clock.keep_alive`."""

    async def sleep(self, seconds: float) -> None:
        """Sleep for `seconds` of real time."""
        import asyncio  # Imported here, because the guard does not need it.

        await asyncio.sleep(seconds)


def load(place: str) -> Any:
    """Import what is at MODULE:NAME."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def connect(source: str, argument: str) -> Hardware:
    """Return the hardware of a source.

    Args:
        source: MODULE:FUNCTION.
        argument: Argument of the function.
    """
    return load(source)(argument)
