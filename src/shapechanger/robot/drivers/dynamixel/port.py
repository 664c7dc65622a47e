"""The serial port below the SDK."""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from shapechanger.errors import MissingExtra, RobotError
from shapechanger.robot.drivers.dynamixel.settings import BusSettings

try:
    from dynamixel_sdk import PortHandler
except ImportError as error:
    raise MissingExtra("dynamixel-sdk", "finger") from error

__all__ = ["OpenPort", "Port", "PromptPort", "open_serial_port"]

# Bytes that may still be read when the time for an answer is over. They lay there before the
# process was let run again; more is noise that never ends, and the SDK would read it for ever.
_MOST_LATE_BYTES: Final = 1024


class Port(Protocol):
    """What the SDK's packet handler asks of a port; its `PortHandler` is one."""

    is_using: bool

    def clearPort(self) -> None:
        """Forget what has arrived."""
        ...

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes; how many were taken."""
        ...

    def readPort(self, length: int) -> bytes:
        """At most so many bytes of what has arrived."""
        ...

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the time that an answer of so many bytes may take."""
        ...

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start the time that an answer may take."""
        ...

    def isPacketTimeout(self) -> bool:
        """Whether that time is over."""
        ...

    def getBytesAvailable(self) -> int:
        """How many bytes have arrived and were not read."""
        ...

    def getBaudRate(self) -> int:
        """Bits a second."""
        ...

    def closePort(self) -> None:
        """Let go of the device."""
        ...


OpenPort = Callable[[BusSettings], Port]
"""What opens the port of a bus."""


class PromptPort(PortHandler):
    """The SDK's port, which waits for an answer only as long as the bus needs.

    As it comes the SDK waits 34 ms for each missing answer, on the clock that a change of the date
    moves, and asks the processor all the while. A stop cannot wait for that.

    Args:
        device: Where it is.
        answer_ms: How long the servos may take to begin to answer.
    """

    def __init__(self, device: str, answer_ms: float) -> None:
        super().__init__(device)
        self._answer_ms = answer_ms
        self._late_bytes = 0

    def getCurrentTime(self) -> float:
        """Milliseconds that no change of the date moves."""
        return time.monotonic_ns() / 1e6

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the time that an answer of so many bytes may take."""
        self.setPacketTimeoutMillis(self.tx_time_per_byte * packet_length + self._answer_ms)

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start the time that an answer may take."""
        self._late_bytes = _MOST_LATE_BYTES
        super().setPacketTimeoutMillis(msec)

    def readPort(self, length: int) -> bytes:
        """At most so many bytes; waits for the first of them while there is time."""
        if length <= 0:
            return b""
        left_ms = self.packet_timeout - self.getTimeSinceStart()
        if left_ms > 0.0:
            select.select([self.ser.fd], [], [], left_ms / 1e3)
            return super().readPort(length)
        data = super().readPort(min(length, self._late_bytes))
        self._late_bytes -= len(data)
        return data


def open_serial_port(settings: BusSettings) -> PromptPort:
    """Open the port of a bus.

    Raises:
        RobotError: If it cannot be opened, or not at this speed.
    """
    port = PromptPort(settings.device, settings.answer_ms)
    try:
        opened = port.setBaudRate(settings.baud)
    except OSError as error:
        raise RobotError(f"The bus at {settings.device} cannot be opened: {error}.") from error
    if not opened:
        raise RobotError(
            f"The bus at {settings.device} cannot have {settings.baud} baud; "
            "57600, 115200, 1000000, 2000000, 3000000 and 4000000 are usual."
        )
    return port
