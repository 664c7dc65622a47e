"""Encoders at joints, at the level of bytes."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.as5600 import JointEncoder
from tests.robot.drivers.fakes import FakeBus, FakeHardware

_MUX, _ENCODER = 0x70, 0x36
_TWO = {
    "bus": 1,
    "mux": _MUX,
    "joints": ["knee", "ankle"],
    "channels": [2, 5],
    "zeros": [100, 4000],
    "directions": [1, -1],
}


def _says(counts: int, status: int = 0x20) -> dict[int, int]:
    return {0x0B: status, 0x0C: counts >> 8, 0x0D: counts & 0xFF}


def _rig() -> tuple[FakeHardware, FakeBus]:
    # Both encoders stand at the same counts: what is behind a multiplexer is the twin's to show.
    hardware = FakeHardware({_MUX: {}, _ENCODER: _says(1124)})
    return hardware, hardware.bus


def test_each_joint_is_asked_on_its_channel() -> None:
    """One bit opens one channel, and nothing else is ever written."""
    hardware, bus = _rig()
    sensor = hardware.sensor("as5600", **_TWO)
    assert bus.writes == [(_MUX, 1 << 2, []), (_MUX, 1 << 5, [])]
    said = sensor.read(0, 0.0)
    assert said["knee/angle"] == pytest.approx(math.pi / 2)
    assert said["ankle/angle"] == pytest.approx(-(1124 - 4000 + 4096) * math.pi / 2048)
    sensor.close()
    assert bus.closed == 1


@given(zero=st.integers(0, 4095), turned=st.integers(-2047, 2047), back=st.booleans())
def test_angles_are_within_half_a_turn_of_the_zero(zero: int, turned: int, back: bool) -> None:
    """Wherever the magnet was glued on."""
    direction = -1 if back else 1
    encoder = JointEncoder("knee", 0, zero, direction)
    angle = encoder.angle((zero + direction * turned) % 4096)
    assert angle == pytest.approx(turned * math.pi / 2048)


def test_unused_bits_of_the_high_byte_are_no_counts() -> None:
    """The angle has 12 bits."""
    hardware, bus = _rig()
    sensor = hardware.sensor("as5600", **_TWO)
    bus.chips[_ENCODER][0x0C] |= 0xF0
    assert sensor.read(0, 0.0)["knee/angle"] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("chips", "words"),
    [
        ({_MUX: {}}, "The encoder of knee, on channel 2, does not answer"),
        ({_ENCODER: _says(0)}, "The multiplexer of sensor .* at 0x70 on I2C bus 1 does not answer"),
        ({_MUX: {}, _ENCODER: _says(0, 0x10)}, "knee, on channel 2, detects no magnet"),
    ],
)
def test_what_is_missing_is_said_at_once_when_it_is_opened(
    chips: dict[int, dict[int, int]], words: str
) -> None:
    """And the bus is let go."""
    hardware = FakeHardware(chips)
    with pytest.raises(RobotError, match=words):
        hardware.sensor("as5600", **_TWO)
    assert hardware.bus.closed == 1


def test_a_joint_may_be_missing_for_a_moment() -> None:
    """It is absent, and a fault only from the fifth reading in a row on; then it may come back."""
    hardware, bus = _rig()
    sensor = hardware.sensor("as5600", **_TWO)
    for _ in range(2):
        bus.chips[_ENCODER][0x0B] = 0x10
        for _ in range(4):
            assert sensor.read(0, 0.0) == {}
        bus.chips[_ENCODER][0x0B] = 0x20
        assert set(sensor.read(0, 0.0)) == {"knee/angle", "ankle/angle"}
    bus.chips[_ENCODER][0x0B] = 0x10
    for _ in range(4):
        assert sensor.read(0, 0.0) == {}
    for _ in range(2):
        with pytest.raises(RobotError, match=r"knee, .* no magnet\. The encoder of ankle"):
            sensor.read(0, 0.0)


def test_a_multiplexer_that_is_gone_is_said_once() -> None:
    """Not for each joint behind it."""
    hardware, bus = _rig()
    sensor = hardware.sensor("as5600", **_TWO)
    del bus.chips[_MUX]
    for _ in range(4):
        assert sensor.read(0, 0.0) == {}
    with pytest.raises(RobotError) as caught:
        sensor.read(0, 0.0)
    assert str(caught.value).count("does not answer") == 1
