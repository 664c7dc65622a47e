"""Parts that need no bus: detection of lost tendons, and codes of registers."""

import pytest

from shapechanger.robot.drivers.servos.family import FAMILIES
from shapechanger.robot.drivers.servos.tendon import TendonServo
from tests.robot.drivers.servos.rigs import Rig

MS = 1_000_000
DYNAMIXEL, FEETECH = FAMILIES["Dynamixel"], FAMILIES["Feetech"]
_MM = -4096 / (2 * 3.14159 * 5)  # Counts for a millimetre of length on a spool of 5 mm.


def _see(one: TendonServo, mm_per_s: float, now_ms: int, length_mm: float = 0.0) -> str:
    """Return the fault after a cycle in which a tendon has a length and gets longer."""
    speed = round(-mm_per_s / 5 / DYNAMIXEL.rad_per_s)
    position = round(length_mm * _MM)
    data = b"\0\0" + speed.to_bytes(4, "little", signed=True)
    data += position.to_bytes(4, "little", signed=True) + bytes(8) + b"\x32\0\x1e"
    one.see(data, now_ms * MS, pulls=True)
    return one.fault


@pytest.fixture
def one() -> TendonServo:
    """A servo with a zero. 70 % of its speed without load, 383 turns/min, are 140 mm/s."""
    rig = Rig()
    made = TendonServo(rig.settings.servos[0], rig.settings)
    made.zero = 0
    return made


def test_a_fast_tendon_is_slack_only_after_a_while(one: TendonServo) -> None:
    """A short flick of the finger is not a snapped tendon; a pause restarts the timer."""
    speeds = [(-150, 0), (-150, 99), (-130, 100), (-150, 110), (-150, 209)]
    assert [_see(one, speed, at_ms) for speed, at_ms in speeds] == [""] * 5
    assert "winds in at 150 mm/s" in _see(one, -150, 210)


def test_unwinding_fast_is_not_slack(one: TendonServo) -> None:
    assert [_see(one, 500, t, 10) for t in (0, 500)] == ["", ""]


def test_a_tendon_shorter_than_the_finger_allows_is_slack_at_once(one: TendonServo) -> None:
    assert "wound in by 61 mm" in _see(one, 0, 0, -61)


def test_present_values_of_dynamixel_are_signed() -> None:
    """Velocity -3 is FD FF FF FF, which protocol 2.0 must stuff."""
    data = bytes.fromhex("ffff fdffffff 00f0ffff 00000000 00000000 3200 1f".replace(" ", ""))
    present = DYNAMIXEL.decode(data)
    assert present.current == -1
    assert present.speed == pytest.approx(-3 * 0.0239808, rel=1e-4)
    assert present.position == -4096
    assert present.voltage == pytest.approx(5.0)
    assert present.temperature == 31.0


def test_present_values_of_feetech_have_a_bit_for_the_sign() -> None:
    """Position, speed, load, voltage, temperature, two flags, status, and last the current."""
    data = bytes.fromhex("0590 0380 0000 4a 1f 00 00 00 0000 0780".replace(" ", ""))
    present = FEETECH.decode(data)
    assert present.position == -4101
    assert present.speed == pytest.approx(-3 * 0.00153398, rel=1e-4)
    assert (present.current, present.temperature) == (-7, 31.0)
    assert present.voltage == pytest.approx(7.4)


@pytest.mark.parametrize("value", [0, 1, -1, 4095, -4101, 32766, -32766])
@pytest.mark.parametrize("family", [DYNAMIXEL, FEETECH])
def test_encoded_values_decode_to_themselves(value: int, family: object) -> None:
    """Two's complement and a bit for the sign both keep the value."""
    register = (FEETECH if family is FEETECH else DYNAMIXEL).goal_position
    assert register.decode(register.encode(value)) == value


def test_each_hardware_error_has_a_description() -> None:
    """Bit 1 is unused by Dynamixel; Feetech has six."""
    assert DYNAMIXEL.error_words(0x24) == "it is overheated, it is overloaded"
    assert DYNAMIXEL.error_words(0x02) == "it gives the unknown code 2"
    assert FEETECH.error_words(0x12) == "its encoder fails, its angle is out of range"
