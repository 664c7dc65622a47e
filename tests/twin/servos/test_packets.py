"""Packets against the examples of the ROBOTIS e-manual, DYNAMIXEL Protocol 2.0."""

import pytest
from dynamixel_sdk import PacketHandler
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.twin.servos.protocol import Packet, Parser, crc16, pack, status

_EXAMPLES = {
    "ping": ("FF FF FD 00 01 03 00 01 19 4E", pack(1, 1, b"")),
    "ping of all": ("FF FF FD 00 FE 03 00 01 31 42", pack(0xFE, 1, b"")),
    "answer to a ping": (
        "FF FF FD 00 01 07 00 55 00 06 04 26 65 5D",
        status(1, 0, b"\x06\x04\x26"),
    ),
    "read": (
        "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15",
        pack(1, 2, b"\x84\x00\x04\x00"),
    ),
    "answer to a read": (
        "FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0",
        status(1, 0, b"\xa6\x00\x00\x00"),
    ),
    "write": (
        "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
        pack(1, 3, b"\x74\x00\x00\x02\x00\x00"),
    ),
    "answer to a write": ("FF FF FD 00 01 04 00 55 00 A1 0C", status(1, 0)),
    "reboot": ("FF FF FD 00 01 03 00 08 2F 4E", pack(1, 8, b"")),
    "sync read": (
        "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA",
        pack(0xFE, 0x82, b"\x84\x00\x04\x00\x01\x02"),
    ),
    "sync write": (
        "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
        pack(0xFE, 0x83, b"\x74\x00\x04\x00\x01\x96\x00\x00\x00\x02\xaa\x00\x00\x00"),
    ),
}


@pytest.mark.parametrize("name", _EXAMPLES)
def test_packets_are_those_of_the_manual(name: str) -> None:
    """Byte by byte, the CRC too."""
    expected, made = _EXAMPLES[name]
    assert made == bytes.fromhex(expected)


@pytest.mark.parametrize("name", _EXAMPLES)
def test_packets_of_the_manual_are_understood(name: str) -> None:
    """Packets are parsed, however the bytes arrive."""
    data = bytes.fromhex(_EXAMPLES[name][0])
    parser = Parser()
    found = [packet for byte in data for packet in parser.feed(bytes([byte]))]
    assert found == [Packet(data[4], data[7], data[8:-2], True)]
    assert not parser.waits


@given(data=st.binary(max_size=200))
def test_the_crc_is_that_of_the_sdk(data: bytes) -> None:
    """Two programs that know nothing of each other agree."""
    assert crc16(data) == PacketHandler(2.0).updateCRC(0, data, len(data))


@given(
    noise=st.binary(max_size=20).filter(lambda b: b"\xff" not in b),
    body=st.lists(st.sampled_from([b"\xff\xff\xfd", b"\xff", b"\xfd", b"U"]), max_size=9).map(
        b"".join
    ),
)
def test_any_body_survives_stuffing(noise: bytes, body: bytes) -> None:
    """Also one full of headers, and behind noise."""
    whole = pack(7, 3, body)
    assert b"\xff\xff\xfd" not in whole[7:].replace(b"\xff\xff\xfd\xfd", b".")[:-2]
    assert Parser().feed(noise + whole) == [Packet(7, 3, body, True)]


def test_a_damaged_packet_does_not_hide_the_next() -> None:
    """It is reported, and the next one is found."""
    good, bad = pack(1, 1, b""), bytearray(pack(2, 1, b""))
    bad[-1] ^= 1
    found = Parser().feed(bytes(bad) + good)
    assert [(one.id, one.is_valid) for one in found] == [(2, False), (1, True)]


def test_a_length_that_lies_does_not_stop_the_parser() -> None:
    """A header with a length of 0 or 60000 does not start a packet."""
    lies = b"\xff\xff\xfd\x00\x01\x00\x00" + b"\xff\xff\xfd\x00\x01\x60\xea"
    assert Parser().feed(lies + pack(1, 1, b"")) == [Packet(1, 1, b"", True)]
