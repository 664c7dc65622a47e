"""Parts that need no bus: detection of slack, and decoding."""

import pytest

from shapechanger.robot.drivers.dynamixel.health import SlackDetector
from shapechanger.robot.drivers.dynamixel.protocol import decode_present, hardware_errors

MS = 1_000_000


def test_a_fast_tendon_is_slack_only_after_a_while() -> None:
    """A short flick of the finger is not a snapped tendon; a pause restarts the timer."""
    slack = SlackDetector(0.1 / 0.7)
    assert slack.see(None, -0.2, 0) == ""
    assert slack.see(None, -0.2, 99 * MS) == ""
    assert slack.see(None, -0.05, 100 * MS) == ""
    assert slack.see(None, -0.2, 110 * MS) == ""
    assert "winds in at 200 mm/s" in slack.see(None, -0.2, 210 * MS)


def test_unwinding_fast_is_not_slack() -> None:
    """Only winding in without load counts."""
    slack = SlackDetector(0.1 / 0.7)
    assert [slack.see(0.01, 0.5, t * MS) for t in (0, 500)] == ["", ""]


def test_a_tendon_shorter_than_the_finger_allows_is_slack_at_once() -> None:
    """A length outside the finger's range is reported immediately."""
    assert "wound in by 61 mm" in SlackDetector(0.1 / 0.7).see(-0.061, 0.0, 0)


def test_present_values_are_signed() -> None:
    """Velocity -3 is FD FF FF FF, which protocol 2.0 must stuff."""
    data = bytes.fromhex("ffff fdffffff 00f0ffff 00000000 00000000 3200 1f".replace(" ", ""))
    present = decode_present(data)
    assert present.current == -1
    assert present.speed == pytest.approx(-3 * 0.0239808, rel=1e-4)
    assert present.position == -4096
    assert present.voltage == pytest.approx(5.0)
    assert present.temperature == 31.0


def test_each_hardware_error_has_a_description() -> None:
    """Bit 1 is unused."""
    assert hardware_errors(0x24) == ("it is overheated", "it is overloaded")
    assert hardware_errors(0x02) == ()
