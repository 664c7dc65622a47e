"""Hardware below the drivers: pins, buses and clocks, real or of a twin.

The processes of a robot get the source of their hardware as MODULE:NAME and one argument, so the
same drivers run on a Raspberry Pi and on a twin; drivers, guard and daemon import no twin.
"""

from __future__ import annotations

import importlib
import select
import time
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Final, NamedTuple

from shapechanger.errors import RobotError, translate_errors

REAL: Final = "shapechanger.robot.hardware:Hardware"
"""Default source of the hardware."""


class Clock:
    """The machine's monotonic clock; the clocks of twins override some or all methods.

    Attributes:
        is_real: Whether the hardware needs time to respond; a twin's chips respond at once.
    """

    is_real: ClassVar = True

    def now_ns(self) -> int:
        """Return the time of CLOCK_MONOTONIC, ns."""
        return time.monotonic_ns()

    def wait(self, readable: Sequence[int], until_ns: int, at_most_s: float) -> bool:
        """Wait in the guard for a readable descriptor or a time, ns.

        Args:
            readable: File descriptors.
            until_ns: The time, ns.
            at_most_s: Limit in real time, s, so that the guard can send heartbeats while a twin's
                time stands still.

        Returns:
            False if only the limit was reached. On a twin's own clock, True exactly if the board
            has ended the wait, at a tick or another event.
        """
        left_s = min((until_ns - time.monotonic_ns()) / 1e9, at_most_s)
        poll = select.poll()
        for fd in readable:
            poll.register(fd, select.POLLIN)
        ready = poll.poll(max(0.0, left_s * 1e3))
        return bool(ready) or time.monotonic_ns() >= until_ns

    def keep_alive(self, beat: Callable[[], object]) -> None:
        """Let a call to the hardware send heartbeats while a twin's board is delayed.

        `beat` sends a heartbeat if it is due. On a robot this has no effect: a guard that hangs in
        a call of a bus must send no heartbeats, so that it is replaced.
        """

    async def sleep(self, seconds: float) -> int | None:
        """Let `seconds` pass in the daemon, and return when the newest frame was captured, ns.

        The daemon can wait for that frame. None if frames are not tied to steps.
        """
        import asyncio  # Imported here, because the guard does not need it.

        await asyncio.sleep(seconds)


class ServoReply(NamedTuple):
    """Reply of a servo.

    Attributes:
        error: Error byte of the status packet.
        data: Data of the status packet.
    """

    error: int
    data: bytes


class Hardware:
    """Pins, buses and clock of this machine, a Raspberry Pi; a twin overrides all of them.

    Each library is imported when it is needed.

    Args:
        _: Argument of a twin's hardware.

    Attributes:
        clock: Clock of this process.
    """

    def __init__(self, _: str = "") -> None:
        self.clock = Clock()
        self._pin_factory: Any = None

    def pin_factory(self) -> Any:
        """Return gpiozero's factory for lgpio, independent of the environment variables.

        Its pins go low at once, and it sends servo pulses; see `lgpio_pins.LowAtOnceFactory`.

        Raises:
            RobotError: If the pins do not exist or cannot be opened.
        """
        if self._pin_factory is None:
            with translate_errors(
                Exception,  # Raised by gpiozero or lgpio, or one of them is missing.
                to=lambda error: RobotError(
                    f"Cannot open this machine's pins ({str(error) or type(error).__name__}); "
                    "`shapechanger robot serve --twin` needs none."
                ),
            ):
                from shapechanger.robot.lgpio_pins import LowAtOnceFactory  # lgpio, an extra.

                self._pin_factory = LowAtOnceFactory()
        return self._pin_factory

    def i2c(self, bus: int) -> Any:
        """Open the I2C bus of a number, with smbus2.

        The drivers use `write_byte`, `read_i2c_block_data`, `write_i2c_block_data` and `close` of
        `smbus2.SMBus`.
        """
        from smbus2 import SMBus

        return SMBus(bus)

    def servo_port(self, settings: Any, open_port: Callable[[Any], Any]) -> Any:
        """Open the port of a servo bus: a `ServoPort` of `drivers.servos`, for its `BusSettings`.

        `open_port` opens a serial port of this machine.
        """
        return open_port(settings)

    def close(self) -> None:
        """Close the pins; whoever opened a bus or port closes it."""
        if self._pin_factory is not None:
            self._pin_factory.close()
            self._pin_factory = None


def load(place: str) -> Any:
    """Import the object MODULE:NAME."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def connect(source: str, argument: str) -> Hardware:
    """Return the hardware of a source, MODULE:NAME, which is called with the argument."""
    return load(source)(argument)
