"""Serial port of a servo bus, with the packets of `dynamixel_sdk`."""

from __future__ import annotations

import contextlib
import select
import termios
import time
from collections.abc import Mapping, Sequence
from typing import Final

from shapechanger.errors import MissingExtra, RobotError, translate_errors
from shapechanger.robot.drivers.servos.settings import BusSettings
from shapechanger.robot.hardware import ServoReply

with translate_errors(ImportError, to=lambda _: MissingExtra("dynamixel-sdk", "finger")):
    from dynamixel_sdk import PacketHandler, PortHandler

# Bytes that may still be read after the timeout of an answer, because they arrived while the
# process did not run. More bytes are noise, which the SDK would read indefinitely.
_MAX_LATE_BYTES: Final = 1024
# Damaged packets to skip while waiting for valid ones.
_MAX_DAMAGED: Final = 8
_STATUS_BYTES: Final = 11  # Largest status packet without data.

_BROADCAST: Final = 0xFE
_WRITE: Final = 0x03
_SYNC_READ: Final = 0x82
_SYNC_WRITE: Final = 0x83

# Results of the SDK (robotis_def.py).
_SUCCESS: Final = 0
_RX_TIMEOUT: Final = -3001


class SerialServoPort(PortHandler):
    """The SDK's port, which sends instructions and receives replies; see `ServoPort`.

    It waits for an answer for `answer_ms` and the time of its bytes. The SDK itself busy-waits 34
    ms for each missing answer, by the wall clock, too long for a stop. The family sets the packets.
    """

    def __init__(self, settings: BusSettings) -> None:
        super().__init__(settings.device)
        self._settings = settings
        family = settings.family
        self._refused = family.refused
        self._sdk = PacketHandler(family.protocol)
        # A packet has its id and then the length of the rest, of 1 or 2 bytes.
        self._id_at, self._length_size = (4, 2) if family.protocol == 2.0 else (2, 1)
        self._receive_options = (False,) if family.protocol == 2.0 else ()
        self._late_bytes = 0
        self.has_stray = False
        bus = f"The bus at {settings.device}"
        with translate_errors(
            OSError, to=lambda error: RobotError(f"{bus} cannot be opened: {error}.")
        ):
            opened = self.setBaudRate(settings.baud)
        if not opened:
            raise RobotError(
                f"{bus} cannot have {settings.baud} baud; "
                "57600, 115200, 1000000, 2000000, 3000000 and 4000000 are usual."
            )

    def getCurrentTime(self) -> float:
        """Return the monotonic time in milliseconds."""
        return time.monotonic_ns() / 1e6

    def setPacketTimeout(self, packet_length: int) -> None:
        """Start the timeout of an answer of `packet_length` bytes."""
        self.setPacketTimeoutMillis(
            self.tx_time_per_byte * packet_length + self._settings.answer_ms
        )

    def setPacketTimeoutMillis(self, msec: float) -> None:
        """Start a timeout."""
        self._late_bytes = _MAX_LATE_BYTES
        super().setPacketTimeoutMillis(msec)

    def readPort(self, length: int) -> bytes:
        """Return at most `length` bytes, waiting for the first until the timeout."""
        if length <= 0:
            return b""
        left_ms = self.packet_timeout - self.getTimeSinceStart()
        if left_ms > 0.0:
            select.select([self.ser.fd], [], [], left_ms / 1e3)
            return super().readPort(length)
        data = super().readPort(min(length, self._late_bytes))
        self._late_bytes -= len(data)
        return data

    def read(self, ids: Sequence[int], at: int, size: int) -> dict[int, ServoReply]:
        """Read bytes of several servos; see `ServoPort.read`."""
        parameters = self._number(at) + self._number(size) + bytes(ids)
        return self._exchange(_BROADCAST, _SYNC_READ, parameters, ids, size)

    def write(self, data: Mapping[int, bytes], at: int) -> dict[int, ServoReply]:
        """Write bytes of several servos, or of one; see `ServoPort.write`."""
        if len(data) == 1:
            ((servo_id, content),) = data.items()
            return self._exchange(servo_id, _WRITE, self._number(at) + content, (servo_id,), 0)
        size = len(next(iter(data.values())))
        items = b"".join(bytes([one]) + content for one, content in data.items())
        parameters = self._number(at) + self._number(size) + items
        return self._exchange(_BROADCAST, _SYNC_WRITE, parameters, (), 0)

    def close(self) -> None:
        """Close the port."""
        with contextlib.suppress(OSError, termios.error):  # A device that is gone counts as closed.
            self.closePort()

    def _number(self, value: int) -> bytes:
        return value.to_bytes(self._length_size, "little")

    def _exchange(
        self, servo_id: int, instruction: int, parameters: bytes, ids: Sequence[int], length: int
    ) -> dict[int, ServoReply]:
        """Send an instruction and return the replies of `ids`, each with `length` bytes of data."""
        device = self._settings.device
        size = self._number(len(parameters) + 1 + self._length_size)
        # The SDK fills in the header and the checksum, which has as many bytes as the length.
        packet = [0] * self._id_at + [servo_id, *size, instruction, *parameters]
        self.is_using = False  # The SDK leaves it set after an exception.
        with translate_errors(
            OSError, termios.error, to=lambda e: RobotError(f"The bus at {device} is gone: {e}.")
        ):
            self.has_stray |= self.getBytesAvailable() > 0
            if self._sdk.txPacket(self, packet + [0] * self._length_size) != _SUCCESS:
                raise RobotError(f"The bus at {device} does not accept the data written to it.")
            if not ids:
                return {}
            self.setPacketTimeout((_STATUS_BYTES + length) * len(ids))
            return self._replies(ids, length)

    def _replies(self, ids: Sequence[int], length: int) -> dict[int, ServoReply]:
        # The SDK's GroupSyncRead stops at the first missing servo, drops the other answers and
        # keeps no error byte; so the packets are received one by one here.
        heard: dict[int, ServoReply] = {}
        for _ in range(len(ids) + _MAX_DAMAGED):
            try:
                packet, result = self._sdk.rxPacket(self, *self._receive_options)
            except IndexError:  # The SDK does not check the length in a packet.
                continue
            if result == _RX_TIMEOUT:
                break
            if result != _SUCCESS:
                continue
            rest = self._id_at + 1 + self._length_size
            size = int.from_bytes(bytes(packet[self._id_at + 1 : rest]), "little")
            # Packets of 2.0 repeat that they are a status; the error byte is the last before data.
            data_at = rest + self._length_size
            data = bytes(packet[data_at : rest + size - self._length_size])
            reply, servo_id = ServoReply(packet[data_at - 1], data), packet[self._id_at]
            if servo_id in ids and (len(data) == length or reply.error & self._refused):
                heard[servo_id] = reply
            if len(heard) == len(ids):
                break
        return heard
