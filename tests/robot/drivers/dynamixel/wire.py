"""Packets of a simulated bus, packed and unpacked by the SDK."""

from __future__ import annotations

from dynamixel_sdk import PacketHandler

from shapechanger.twin.servos.bus import SimulatedBus

_SDK = PacketHandler(2.0)
_STATUS = 0x55


def pack(servo_id: int, code: int, body: bytes) -> bytes:
    """Return a packet."""
    size = (len(body) + 3).to_bytes(2, "little")
    plain = [0xFF, 0xFF, 0xFD, 0, servo_id, *size, code, *body, 0, 0]
    stuffed = _SDK.addStuffing(plain)[:-2]
    return bytes(stuffed) + _SDK.updateCRC(0, stuffed, len(stuffed)).to_bytes(2, "little")


def status(servo_id: int, error: int, data: bytes = b"") -> bytes:
    """Return a status packet."""
    return pack(servo_id, _STATUS, bytes([error]) + data)


def size_of(data: bytes | bytearray) -> int:
    """Return the size of the packet at the start of `data`, once its header is there."""
    return 7 + int.from_bytes(data[5:7], "little")


def execute(bus: SimulatedBus, packet: bytes) -> dict[int, bytes]:
    """Execute a packet on the bus and return the status packets by servo id."""
    plain = _SDK.removeStuffing(list(packet))
    replies = bus.execute(plain[4], plain[7], bytes(plain[8 : size_of(bytes(plain[:7])) - 2]))
    return {one: status(one, reply.error, reply.data) for one, reply in replies.items()}
