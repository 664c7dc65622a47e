"""Packets of protocol 2.0, from the servo's side.

Source: ROBOTIS e-manual, DYNAMIXEL Protocol 2.0. Nothing here comes from the SDK, so that each
tests the other.
"""

from __future__ import annotations

from typing import Final, NamedTuple

__all__ = ["BROADCAST", "Packet", "Parser", "crc16", "packed", "status"]

BROADCAST: Final = 0xFE
"""The id that means everybody."""

_HEADER: Final = b"\xff\xff\xfd"
_STATUS: Final = 0x55
_BEFORE_LENGTH: Final = 7  # Header, reserved byte, id and the length itself.
_LEAST_LENGTH: Final = 3  # Instruction and CRC.
# Assumed: what a servo can hold. The SDK sends no more.
_MOST_LENGTH: Final = 1024


class Packet(NamedTuple):
    """An instruction that has arrived.

    Attributes:
        id: Who is meant.
        instruction: Its code.
        parameters: What it needs; stuffing is removed.
        is_whole: Whether its CRC fits.
    """

    id: int
    instruction: int
    parameters: bytes
    is_whole: bool


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
    """CRC-16 with the polynomial x^16 + x^15 + x^2 + 1, starting from `crc`."""
    for byte in data:
        crc = (crc << 8 & 0xFFFF) ^ _CRC[crc >> 8 ^ byte]
    return crc


def packed(servo_id: int, code: int, body: bytes, *, stuffs: bool = True) -> bytes:
    """A whole packet.

    Args:
        servo_id: Whose, or for whom.
        code: The instruction, or 0x55 for a status.
        body: What follows it, up to the CRC.
        stuffs: Whether FF FF FD becomes FF FF FD FD in it.
    """
    inner = bytes([code]) + body
    if stuffs:
        inner = inner.replace(_HEADER, _HEADER + b"\xfd")
    length = len(inner) + 2
    whole = _HEADER + bytes([0, servo_id]) + length.to_bytes(2, "little") + inner
    return whole + crc16(whole).to_bytes(2, "little")


def status(servo_id: int, error: int, data: bytes = b"") -> bytes:
    """What a servo answers."""
    return packed(servo_id, _STATUS, bytes([error]) + data)


class Parser:
    """Finds packets in a stream of bytes, whatever lies between them."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    @property
    def waits(self) -> bool:
        """Whether it holds the beginning of a packet."""
        return bool(self._bytes)

    def forget(self) -> None:
        """Drop the beginning of a packet whose end never came."""
        self._bytes.clear()

    def feed(self, data: bytes) -> list[Packet]:
        """The packets that end in these bytes."""
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
                del held[: max(0, len(held) - 2)]  # FF FF may be the beginning of a header.
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
        is_whole = crc16(whole[:-2]) == int.from_bytes(whole[-2:], "little")
        # A damaged packet may have swallowed the header of the next one.
        del held[: end if is_whole else 1]
        inner = whole[_BEFORE_LENGTH:-2].replace(_HEADER + b"\xfd", _HEADER)
        return Packet(whole[4], inner[0], inner[1:], is_whole)
