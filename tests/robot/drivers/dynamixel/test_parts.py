"""The parts that know no bus: the ramp of a stop, and the eye for slack."""

import pytest

from shapechanger.robot.drivers.dynamixel.bus import Ramp
from shapechanger.robot.drivers.dynamixel.health import SlackDetector
from shapechanger.robot.drivers.dynamixel.protocol import decode_present, hardware_errors

MS = 1_000_000


def test_a_ramp_goes_down_in_a_straight_line_in_its_time() -> None:
    """Half of the way after half of the time, and all of it at the end."""
    ramp = Ramp({"FDP": 10.0}, {"FDP": 2.0}, 5 * MS, 100)
    assert [ramp.tensions(t * MS)["FDP"] for t in (0, 5, 55, 105, 900)] == pytest.approx(
        [10.0, 10.0, 6.0, 2.0, 2.0]
    )
    assert not ramp.is_over(104 * MS)
    assert ramp.is_over(105 * MS)


def test_a_ramp_of_no_time_is_over_at_once() -> None:
    """Nothing divides by zero."""
    ramp = Ramp({"FDP": 10.0}, {"FDP": 2.0}, 5 * MS, 0)
    assert ramp.tensions(5 * MS) == {"FDP": 2.0}
    assert ramp.is_over(5 * MS)


def test_a_stop_never_pulls_harder_than_its_end() -> None:
    """A tendon below the pretension is taken to it, not beyond."""
    ramp = Ramp({"FDP": 0.0}, {"FDP": 2.0}, 0, 100)
    assert ramp.tensions(50 * MS) == {"FDP": 2.0}


def test_a_fast_tendon_is_slack_only_after_a_while() -> None:
    """A quick flick of the finger is no snapped tendon; a pause restarts the time."""
    slack = SlackDetector(0.1 / 0.7)
    assert slack.see(None, -0.2, 0) == ""
    assert slack.see(None, -0.2, 99 * MS) == ""
    assert slack.see(None, -0.05, 100 * MS) == ""
    assert slack.see(None, -0.2, 110 * MS) == ""
    assert "winds in at 200 mm/s" in slack.see(None, -0.2, 210 * MS)


def test_a_tendon_that_is_let_out_fast_is_not_slack() -> None:
    """Only winding in without a load counts."""
    slack = SlackDetector(0.1 / 0.7)
    assert [slack.see(0.01, 0.5, t * MS) for t in (0, 500)] == ["", ""]


def test_a_tendon_shorter_than_the_finger_allows_is_slack_at_once() -> None:
    """Nothing else can have happened."""
    assert "wound in by 61 mm" in SlackDetector(0.1 / 0.7).see(-0.061, 0.0, 0)


def test_present_values_are_read_with_their_signs() -> None:
    """-3 counts of velocity are FD FF FF FF, the bytes that protocol 2.0 must stuff."""
    data = bytes.fromhex("ffff fdffffff 00f0ffff 00000000 00000000 3200 1f".replace(" ", ""))
    present = decode_present(data)
    assert present.current == -1
    assert present.speed == pytest.approx(-3 * 0.0239808, rel=1e-4)
    assert present.position == -4096
    assert present.voltage == pytest.approx(5.0)
    assert present.temperature == 31.0


def test_each_hardware_error_has_its_words() -> None:
    """Bit 1 means nothing, the others do."""
    assert hardware_errors(0x24) == ("it is overheated", "it is overloaded")
    assert hardware_errors(0x02) == ()
