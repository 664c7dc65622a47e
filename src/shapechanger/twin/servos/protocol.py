"""Packets and registers of Dynamixel protocol 2.0, from the servo's side.

Source: ROBOTIS e-manual, DYNAMIXEL Protocol 2.0. Nothing here comes from the SDK, so that each
tests the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

from shapechanger.twin.servos.motor import TwinModel

BROADCAST: Final = 0xFE
"""Id that addresses all servos."""

_HEADER: Final = b"\xff\xff\xfd"
_STATUS: Final = 0x55
_BEFORE_LENGTH: Final = 7  # Header, reserved byte, id and the length itself.
_LEAST_LENGTH: Final = 3  # Instruction and CRC.
# Assumed: buffer of a servo. The SDK sends no longer packets.
_MOST_LENGTH: Final = 1024


class Packet(NamedTuple):
    """An instruction packet.

    Attributes:
        id: Id of the addressed servo.
        instruction: Code of the instruction.
        parameters: Parameters, without stuffing.
        is_valid: Whether the CRC matches.
    """

    id: int
    instruction: int
    parameters: bytes
    is_valid: bool


def _table() -> tuple[int, ...]:
    values: list[int] = []
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ 0x8005 if crc & 0x8000 else crc << 1
        values.append(crc & 0xFFFF)
    return tuple(values)


_CRC: Final = _table()


def crc16(data: bytes, crc: int = 0) -> int:
    """Return the CRC-16 with the polynomial x^16 + x^15 + x^2 + 1, starting from `crc`."""
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _CRC[crc >> 8 ^ byte]
    return crc


def pack(servo_id: int, code: int, body: bytes, *, stuffs: bool = True) -> bytes:
    """Return a packet.

    Args:
        servo_id: Id of the sender or the addressee.
        code: Code of the instruction, or 0x55 for a status.
        body: Bytes between the code and the CRC.
        stuffs: Whether to replace FF FF FD by FF FF FD FD in it.
    """
    inner = bytes([code]) + body
    if stuffs:
        inner = inner.replace(_HEADER, _HEADER + b"\xfd")
    length = len(inner) + 2
    whole = _HEADER + bytes([0, servo_id]) + length.to_bytes(2, "little") + inner
    return whole + crc16(whole).to_bytes(2, "little")


def status(servo_id: int, error: int, data: bytes = b"") -> bytes:
    """Return the status packet of a servo."""
    return pack(servo_id, _STATUS, bytes([error]) + data)


class Parser:
    """Finds packets in a stream of bytes, and skips whatever lies between them."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    @property
    def waits(self) -> bool:
        """True if it holds the start of a packet."""
        return bool(self._bytes)

    def forget(self) -> None:
        """Discard the start of a packet whose end never came."""
        self._bytes.clear()

    def feed(self, data: bytes) -> list[Packet]:
        """Return the packets that end in these bytes."""
        self._bytes += data
        found: list[Packet] = []
        while (packet := self._next()) is not None:
            found.append(packet)
        return found

    def _next(self) -> Packet | None:
        held = self._bytes
        while True:
            start = held.find(_HEADER)
            if start < 0:
                del held[: max(0, len(held) - 2)]  # FF FF may start a header.
                return None
            del held[:start]
            if len(held) < _BEFORE_LENGTH:
                return None
            length = int.from_bytes(held[5:7], "little")
            if held[3] == 0 and _LEAST_LENGTH <= length <= _MOST_LENGTH:
                break
            del held[:1]
        end = _BEFORE_LENGTH + length
        if len(held) < end:
            return None
        whole = bytes(held[:end])
        is_valid = crc16(whole[:-2]) == int.from_bytes(whole[-2:], "little")
        # A damaged packet may have swallowed the header of the next one.
        del held[: end if is_valid else 1]
        inner = whole[_BEFORE_LENGTH:-2].replace(_HEADER + b"\xfd", _HEADER)
        return Packet(whole[4], inner[0], inner[1:], is_valid)


RANGE: Final = 4
_LENGTH: Final = 5
LIMIT: Final = 6
_ACCESS: Final = 7

_EEPROM_END: Final = 64
_MODES: Final = (0, 1, 3, 4, 5, 16)
_ANY: Final = 1 << 31


@dataclass(frozen=True, slots=True)
class _Field:
    """A register; `low` is above `high` for one that cannot be written."""

    size: int
    initial: int = 0
    low: int = 1
    high: int = 0

    @property
    def is_signed(self) -> bool:
        return self.low < 0

    @property
    def is_writable(self) -> bool:
        return self.low <= self.high


def _fields(model: TwinModel) -> dict[int, _Field]:
    low_v, high_v = round(10 * model.least_v), round(10 * model.most_v)
    gain = _Field(2, 0, 0, 16383)
    goal = _Field(4, 0, -_ANY, _ANY - 1)
    return {
        0: _Field(2, model.number),
        2: _Field(4),
        6: _Field(1, 52),
        7: _Field(1, 1, 0, 252),
        8: _Field(1, 1, 0, 7),
        9: _Field(1, 250, 0, 254),
        10: _Field(1, 0, 0, 13),
        11: _Field(1, 3, 0, 16),
        12: _Field(1, 255, 0, 255),
        13: _Field(1, 2, 1, 22),
        20: _Field(4, 0, -1_044_479, 1_044_479),
        24: _Field(4, 10, 0, 1023),
        31: _Field(1, model.most_c, 0, 100),
        32: _Field(2, high_v, low_v, high_v),
        34: _Field(2, low_v, low_v, high_v),
        36: _Field(2, 885, 0, 885),
        38: _Field(2, model.most_counts, 0, model.most_counts),
        44: _Field(4, 1023, 0, 2047),
        48: _Field(4, 4095, 0, 4095),
        52: _Field(4, 0, 0, 4095),
        63: _Field(1, model.shutdown, 0, 63),
        64: _Field(1, 0, 0, 1),
        65: _Field(1, 0, 0, 1),
        68: _Field(1, 2, 0, 2),
        69: _Field(1),
        70: _Field(1),
        76: gain,
        78: gain,
        80: gain,
        82: gain,
        84: gain,
        88: gain,
        90: gain,
        98: _Field(1, 0, 0, 127),
        100: _Field(2, 885, -885, 885),
        102: _Field(2, model.most_counts, -32768, 32767),
        104: goal,
        108: _Field(4, 0, 0, 32767),
        112: _Field(4, 0, 0, 32767),
        116: goal,
        120: _Field(2),
        122: _Field(1),
        123: _Field(1),
        124: _Field(2),
        126: _Field(2),
        128: _Field(4),
        132: _Field(4),
        136: _Field(4),
        140: _Field(4),
        144: _Field(2),
        146: _Field(1),
    }


class TableError(Exception):
    """Error number of a status packet.

    Attributes:
        number: The number.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"error {number}")
        self.number = number


class Table:
    """Control table of a servo.

    Args:
        model: Model of the servo.
        servo_id: Id of the servo.
        firmware: Version of its firmware.
        baud_code: Value of register 8, the baud rate.
        check: Called with address and value before a register is written; raises `TableError`.
    """

    def __init__(
        self,
        model: TwinModel,
        servo_id: int,
        firmware: int,
        baud_code: int,
        check: Callable[[int, int], None],
    ) -> None:
        self._fields = _fields(model)
        self._check = check
        self._bytes = bytearray(147)
        self._known = {at + i for at, field in self._fields.items() for i in range(field.size)}
        for at, field in self._fields.items():
            self.set(at, field.initial)
        for at, value in ((6, firmware), (7, servo_id), (8, baud_code)):
            self.set(at, value)

    def get(self, at: int) -> int:
        """Return the register at an address. Present values are signed."""
        field = self._fields[at]
        signed = field.is_signed or 126 <= at < 144
        data = self._bytes[at : at + field.size]
        return int.from_bytes(data, "little", signed=signed)

    def set(self, at: int, value: int) -> None:
        """Set a register without checks, as the servo itself does."""
        size = self._fields[at].size
        self._bytes[at : at + size] = (value % (1 << 8 * size)).to_bytes(size, "little")

    def lose_power(self) -> None:
        """Reset all registers except those in the EEPROM."""
        for at, field in self._fields.items():
            if at >= _EEPROM_END:
                self.set(at, field.initial)

    def read(self, at: int, length: int) -> bytes:
        """Read bytes.

        Raises:
            TableError: If one of them does not exist. (Assumed: real servos may answer 0 for the
                gaps between registers, so a driver must not rely on an error.)
        """
        if length == 0 or not all(at + i in self._known for i in range(length)):
            raise TableError(_ACCESS)
        return bytes(self._bytes[at : at + length])

    def write(self, at: int, data: bytes) -> list[int]:
        """Write bytes.

        Returns:
            Addresses of the registers that were written.

        Raises:
            TableError: If one of them must not be written; then none of them is.
        """
        wanted: dict[int, int] = {}
        end = at + len(data)
        while at < end:
            field = self._fields.get(at)
            if field is None or not field.is_writable:
                raise TableError(_ACCESS)
            if end - at < field.size:
                raise TableError(_LENGTH)
            part, data = data[: field.size], data[field.size :]
            value = int.from_bytes(part, "little", signed=field.is_signed)
            self._refuse(at, field, value)
            wanted[at] = value
            at += field.size
        if not wanted:
            raise TableError(_LENGTH)
        for address, value in wanted.items():
            self.set(address, value)
        return list(wanted)

    def _refuse(self, at: int, field: _Field, value: int) -> None:
        if at < _EEPROM_END and self.get(64):
            raise TableError(_ACCESS)  # Locked while torque is on.
        if not field.low <= value <= field.high or (at == 11 and value not in _MODES):
            raise TableError(RANGE)
        self._check(at, value)
