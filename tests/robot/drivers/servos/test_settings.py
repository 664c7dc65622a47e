"""Validation of bus and servo settings."""

from typing import Any

import pytest

from shapechanger.robot.drivers.keys import KeyMistake
from shapechanger.robot.drivers.servos.settings import BusSettings
from tests.robot.drivers.servos.rigs import feetech, servo, settings

_NAN = float("nan")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"id": 253}, "must be 0 to 252, not 253"),
        ({"most_tension_n": 60.0}, "must be 0.029 to 51 N with this spool"),
        ({"most_tension_n": _NAN}, "must be 0.029 to 51 N .* not nan N"),
        ({"pretension_n": 21.0}, "must be 0.029 to 20 N, not 21 N"),
        ({"pretension_n": 0.01}, "must be 0.029 to 20 N, not 0.01 N"),
        ({"homing_n": 30.0}, "must be 0.029 to 20 N, not 30 N"),
    ],
)
def test_what_a_servo_cannot_do_is_refused(changes: dict[str, Any], words: str) -> None:
    """Each value that its model does not allow raises an error that names its key."""
    with pytest.raises(KeyMistake, match=words) as caught:
        servo("FDP", **changes)
    assert caught.value.key in changes


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"baud": 12345}, "baud", "one that the servos have, 9600, 57600.*, not 12345"),
        (
            {"servos": (servo("FDP"), feetech("FDS"))},
            "device",
            "cannot have Dynamixel and Feetech servos",
        ),
        ({"servos": (feetech("FDP"),), "baud": 4_000_000}, "baud", "38400.*, not 4000000"),
    ],
)
def test_what_a_bus_cannot_do_is_refused(changes: dict[str, Any], key: str, words: str) -> None:
    """A baud rate that the servos lack and two families raise an error that names its key."""
    with pytest.raises(KeyMistake, match=words) as caught:
        settings(**changes)
    assert caught.value.key == key


def test_the_watchdog_is_on_by_default() -> None:
    assert BusSettings(device="x", servos=(servo("FDP"),)).watchdog_ms == 100


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"control": "tension"},
            "must be 'length', not 'tension', because a Feetech servo has no control of its curren",
        ),
        ({"shortest_m": -0.016}, "must be within 0.0157 m of the zero, half a turn"),
        ({"longest_m": 0.016}, "must be within 0.0157 m of the zero, half a turn"),
        ({"most_tension_n": 400.0}, "must be 0.38 to 382 N with this spool"),
    ],
)
def test_what_a_feetech_servo_cannot_do_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(KeyMistake, match=words) as caught:
        feetech("FDP", **changes)
    assert caught.value.key in changes
