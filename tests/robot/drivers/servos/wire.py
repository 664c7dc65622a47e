"""Packets of a simulated bus, packed and unpacked as on the wire."""

from dynamixel_sdk import PacketHandler

from shapechanger.robot.drivers.servos.settings import FAMILIES, ServoFamily
from shapechanger.robot.drivers.servos.simulation import Rig
from shapechanger.robot.hardware import ServoReply

DYNAMIXEL, FEETECH = FAMILIES["Dynamixel"], FAMILIES["Feetech"]
_SDK = PacketHandler(2.0)
_STATUS = 0x55


def pack(servo_id: int, code: int, body: bytes, family: ServoFamily = DYNAMIXEL) -> bytes:
    if family is FEETECH:
        plain = bytes([servo_id, len(body) + 2, code]) + body
        return b"\xff\xff" + plain + bytes([~sum(plain) & 0xFF])
    size = (len(body) + 3).to_bytes(2, "little")
    raw = [0xFF, 0xFF, 0xFD, 0, servo_id, *size, code, *body, 0, 0]
    stuffed = _SDK.addStuffing(raw)[:-2]
    return bytes(stuffed) + _SDK.updateCRC(0, stuffed, len(stuffed)).to_bytes(2, "little")


def status(servo_id: int, error: int, data: bytes = b"", family: ServoFamily = DYNAMIXEL) -> bytes:
    if family is FEETECH:
        return pack(servo_id, error, data, family)
    return pack(servo_id, _STATUS, bytes([error]) + data)


def family_of(bus: Rig) -> ServoFamily:
    return next(iter(bus.servos.values())).family


def size_of(data: bytes | bytearray, family: ServoFamily = DYNAMIXEL) -> int:
    """Return the size of the packet at the start of `data`, once its header is there."""
    return 4 + data[3] if family is FEETECH else 7 + int.from_bytes(data[5:7], "little")


def execute(bus: Rig, packet: bytes) -> dict[int, bytes]:
    """Execute a packet; return status packets by id. Only protocol 1.0 is checked."""
    family = family_of(bus)
    if family is FEETECH:
        if ~sum(packet[2:-1]) & 0xFF != packet[-1]:
            return {}
        servo_id, code, body, size = packet[2], packet[4], packet[5:-1], 1
    else:
        plain = _SDK.removeStuffing(list(packet))
        end = size_of(bytes(plain[:7])) - 2
        servo_id, code, body, size = plain[4], plain[7], bytes(plain[8:end]), 2
    at, rest = int.from_bytes(body[:size], "little"), body[size:]
    length, content = int.from_bytes(rest[:size], "little"), rest[size:]
    replies: dict[int, ServoReply] = {}
    match code:
        case 0x02:
            replies = bus.read([servo_id], at, length)
        case 0x03:
            replies = bus.write({servo_id: rest}, at)
        case 0x82:
            replies = bus.read(content, at, length)
        case 0x83:
            step = range(0, len(content), length + 1)
            bus.write({content[i]: content[i + 1 : i + 1 + length] for i in step}, at)
        case _:
            pass
    return {one: status(one, reply.error, reply.data, family) for one, reply in replies.items()}
