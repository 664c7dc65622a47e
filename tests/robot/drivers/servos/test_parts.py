"""Parts that need no bus: detection of lost tendons, and codes of registers."""

import pytest

from shapechanger.robot.drivers.servos.family import DYNAMIXEL, FEETECH, Present
from shapechanger.robot.drivers.servos.health import ServoHealth
from tests.robot.drivers.servos.rigs import servo, settings

MS = 1_000_000
# 70 % of the speed without load, 383 turns per minute with a spool of 5 mm, are 140 mm/s.
_FAST, _SLOW = 0.15 / 0.005, 0.13 / 0.005  # rad/s.


def _health() -> ServoHealth:
    return ServoHealth(servo("FDP"), settings())


def _see(health: ServoHealth, speed: float, now_ms: int, length: float | None = None) -> str:
    health.see(Present(0, speed, 0, 5.0, 30.0), length, now_ms * MS, pulls=True)
    return health.fault


def test_a_fast_tendon_is_slack_only_after_a_while() -> None:
    """A short flick of the finger is not a snapped tendon; a pause restarts the timer."""
    health = _health()
    assert _see(health, _FAST, 0) == ""
    assert _see(health, _FAST, 99) == ""
    assert _see(health, _SLOW, 100) == ""
    assert _see(health, _FAST, 110) == ""
    assert _see(health, _FAST, 209) == ""
    assert "winds in at 150 mm/s" in _see(health, _FAST, 210)


def test_unwinding_fast_is_not_slack() -> None:
    """Only winding in without load counts."""
    health = _health()
    assert [_see(health, -100.0, t, 0.01) for t in (0, 500)] == ["", ""]


def test_a_tendon_shorter_than_the_finger_allows_is_slack_at_once() -> None:
    """A length outside the finger's range is reported immediately."""
    assert "wound in by 61 mm" in _see(_health(), 0.0, 0, -0.061)


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
