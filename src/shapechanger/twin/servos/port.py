"""Port of the Dynamixel SDK whose far end is a simulated bus."""

from __future__ import annotations

from collections.abc import Callable, Sequence


class ServoPort:
    """Port for the SDK's packet handler, without real time.

    The simulated servos answer at once. An answer that is late or missing counts as timed out as
    soon as the SDK asks.

    Args:
        exchange: Sends bytes to the bus and returns those that have arrived from it. It is called
            with no bytes to look for late answers.
        baud: Baud rate to report.

    Attributes:
        is_using: Flag of the SDK.
    """

    def __init__(self, exchange: Callable[[bytes], bytes], baud: int = 1_000_000) -> None:
        self._exchange = exchange
        self._baud = baud
        self._arrived = bytearray()
        self.is_using = False

    def clearPort(self) -> None:
        """Discard what has arrived."""
        self._poll()
        self._arrived.clear()

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes and return their number."""
        data = bytes(packet)
        self._arrived += self._exchange(data)
        return len(data)

    def readPort(self, length: int) -> bytes:
        """Return at most `length` bytes of what has arrived."""
        self._poll()
        if length <= 0:
            return b""
        data = bytes(self._arrived[:length])
        del self._arrived[:length]
        return data

    def setPacketTimeout(self, packet_length: int) -> None:
        """Do nothing: answers take no time."""

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Do nothing: answers take no time."""

    def isPacketTimeout(self) -> bool:
        """Return whether nothing is left to read."""
        self._poll()
        return not self._arrived

    def getBytesAvailable(self) -> int:
        """Return the number of bytes that have arrived and were not read."""
        self._poll()
        return len(self._arrived)

    def getBaudRate(self) -> int:
        """Return the baud rate."""
        return self._baud

    def closePort(self) -> None:
        """Do nothing: the bus outlives the port."""

    def _poll(self) -> None:
        self._arrived += self._exchange(b"")
