"""Joint encoders, tested with the bytes on the I2C bus."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.as5600 import JointKeys
from tests.robot.drivers.fakes import FakeBus, FakeHardware

_MUX, _ENCODER = 0x70, 0x36
_KNEE = {"channel": 2, "zero": 100}
_TWO = {"rows": {"knee": _KNEE, "ankle": {"channel": 5, "zero": 4000, "direction": -1}}}


def _registers(counts: int, status: int = 0x20) -> dict[int, int]:
    return {0x0B: status, 0x0C: counts >> 8, 0x0D: counts & 0xFF}


def _rig() -> tuple[FakeHardware, FakeBus]:
    # The fake has one encoder for both channels; only the twin simulates the multiplexer.
    hardware = FakeHardware({_MUX: {}, _ENCODER: _registers(1124)})
    return hardware, hardware.bus


def test_each_joint_is_read_on_its_channel() -> None:
    """One bit selects one channel, and no other register is written."""
    hardware, bus = _rig()
    sensor = hardware.sensor("as5600", **_TWO)
    assert bus.writes == [(_MUX, 1 << 2, []), (_MUX, 1 << 5, [])]
    angles = sensor.read(0, 0.0)
    assert angles["knee/angle"] == pytest.approx(math.pi / 2)
    assert angles["ankle/angle"] == pytest.approx(-(1124 - 4000 + 4096) * math.pi / 2048)
    bus.chips[_ENCODER][0x0C] |= 0xF0  # Unused bits.
    assert sensor.read(0, 0.0) == angles
    sensor.close()
    assert bus.closed == 1


@given(zero=st.integers(0, 4095), turned=st.integers(-2047, 2047), back=st.booleans())
def test_angles_are_within_half_a_turn_of_the_zero(zero: int, turned: int, back: bool) -> None:
    direction = -1 if back else 1
    keys = JointKeys(channel=0, zero=zero, direction=direction)
    angle = keys.angle((zero + direction * turned) % 4096)
    assert angle == pytest.approx(turned * math.pi / 2048)


@pytest.mark.parametrize(
    ("chips", "text"),
    [
        ({_MUX: {}}, "The encoder of knee, on channel 2, does not answer"),
        (
            {_ENCODER: _registers(0)},
            "The multiplexer of sensor .* at 0x70 on I2C bus 1 does not answer",
        ),
        ({_MUX: {}, _ENCODER: _registers(0, 0x10)}, "knee, on channel 2, detects no magnet"),
    ],
)
def test_missing_hardware_is_reported_on_opening(
    chips: dict[int, dict[int, int]], text: str
) -> None:
    hardware = FakeHardware(chips)
    with pytest.raises(RobotError, match=text):
        hardware.sensor("as5600", **_TWO)
    assert hardware.bus.closed == 1


@pytest.mark.parametrize("lost", [_MUX, _ENCODER])
def test_a_short_dropout_is_tolerated(lost: int) -> None:
    """Four failed readings in a row omit the joint; from the fifth on, an error is raised."""
    hardware, bus = _rig()
    sensor = hardware.sensor("as5600", **_TWO)
    chip = bus.chips.pop(lost)
    for _ in range(2):
        assert [sensor.read(0, 0.0) for _ in range(4)] == [{}] * 4
        bus.chips[lost] = chip
        assert set(sensor.read(0, 0.0)) == {"knee/angle", "ankle/angle"}
        del bus.chips[lost]
    assert [sensor.read(0, 0.0) for _ in range(4)] == [{}] * 4
    for _ in range(2):
        with pytest.raises(RobotError) as caught:
            sensor.read(0, 0.0)
        # The multiplexer is reported once, not for each joint.
        assert str(caught.value).count("does not answer") == (1 if lost == _MUX else 2)
