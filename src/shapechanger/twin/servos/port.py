"""A port of the SDK whose far end is a line in the same process, without any time passing."""

from __future__ import annotations

from collections.abc import Sequence

from shapechanger.twin.servos.line import Line

__all__ = ["LinePort"]


class LinePort:
    """What the SDK's packet handler asks of a port, and nothing that depends on the machine.

    An answer is there at once or, if it is late or missing, not at all: then the time for it is
    over as soon as somebody asks.

    Args:
        line: The bus.
        baud: Bits a second, for who asks.

    Attributes:
        is_using: As the SDK wants it.
        is_cut: Whether the cable is cut: what is sent arrives nowhere.
        is_gone: Whether the device is gone: every use raises `OSError`.
        sent: Every packet that was written, for a test to look at.
    """

    def __init__(self, line: Line, baud: int = 1_000_000) -> None:
        self._line = line
        self._baud = baud
        self._arrived = bytearray()
        self.is_using = False
        self.is_cut = False
        self.is_gone = False
        self.is_closed = False
        self.sent: list[bytes] = []

    def inject(self, data: bytes) -> None:
        """Let bytes arrive that no servo has sent."""
        self._arrived += data

    def clearPort(self) -> None:
        """Forget what has arrived."""
        self._pump()
        self._arrived.clear()

    def writePort(self, packet: Sequence[int]) -> int:
        """Send bytes."""
        self._pump()
        data = bytes(packet)
        self.sent.append(data)
        if not self.is_cut:
            self._line.receive(data)
        return len(data)

    def readPort(self, length: int) -> bytes:
        """At most so many bytes of what has arrived."""
        self._pump()
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
        self._pump()
        return not self._arrived

    def getBytesAvailable(self) -> int:
        """How many bytes have arrived and were not read."""
        self._pump()
        return len(self._arrived)

    def getBaudRate(self) -> int:
        """Bits a second."""
        return self._baud

    def closePort(self) -> None:
        """Let go of the line."""
        self.is_closed = True

    def _pump(self) -> None:
        if self.is_gone:
            raise OSError(5, "Input/output error")
        if not self.is_cut:
            self._arrived += self._line.send()
