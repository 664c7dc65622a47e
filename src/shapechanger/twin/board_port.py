"""A port of the SDK whose far end is the servo bus of a board in another process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapechanger.robot.drivers.dynamixel.settings import BusSettings
from shapechanger.robot.hardware import Clock
from shapechanger.twin.wired import BoardLink

__all__ = ["BoardPort"]

_JUST_NOW_NS: Final = 2_000_000


class BoardPort:
    """What the SDK's packet handler asks of a port; an answer takes no time, as at a `LinePort`.

    Args:
        link: The connection to the board.
        clock: The time.
        settings: Of the bus.

    Attributes:
        is_using: As the SDK wants it.

    Raises:
        RobotError: If the board has no servos.
    """

    def __init__(self, link: BoardLink, clock: Clock, settings: BusSettings) -> None:
        self._link = link
        self._clock = clock
        self._asked_ns = 0
        self._baud = settings.baud
        self._arrived = bytearray()
        self.is_using = False
        self._device = settings.device
        self._say(b"")

    def clearPort(self) -> None:
        """Forget what has arrived."""
        self._arrived.clear()

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes."""
        data = bytes(packet)
        self._say(data)
        return len(data)

    def readPort(self, length: int) -> bytes:
        """At most so many bytes of what has arrived."""
        if length <= 0:
            return b""
        data = bytes(self._arrived[:length])
        del self._arrived[:length]
        return data

    def setPacketTimeout(self, packet_length: int) -> None:
        """Nothing: an answer takes no time."""

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Nothing: an answer takes no time."""

    def isPacketTimeout(self) -> bool:
        """Whether nothing more will come."""
        return not self._arrived

    def getBytesAvailable(self) -> int:
        """How many bytes have arrived and were not read."""
        # A board that was asked just now has nothing new, and each question costs a busy one time.
        if self._clock.now_ns() - self._asked_ns > _JUST_NOW_NS:
            self._say(b"")
        return len(self._arrived)

    def getBaudRate(self) -> int:
        """Bits a second."""
        return self._baud

    def closePort(self) -> None:
        """Nothing: the link belongs to somebody else."""

    def _say(self, data: bytes) -> None:
        self._asked_ns = self._clock.now_ns()
        answer = self._link.ask(op="servo", device=self._device, data=data.hex())
        self._arrived += bytes.fromhex(answer["data"])
