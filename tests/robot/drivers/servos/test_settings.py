"""Validation of bus and servo settings."""

from typing import Any

import pytest

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.servos.settings import BusSettings
from tests.robot.drivers.servos.rigs import feetech, servo, settings

_NAN = float("nan")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"id": 253}, "its id must be 0 to 252, not 253"),
        ({"direction": 0}, "its direction must be 1 or -1, not 0"),
        ({"spool_radius_m": 0.0}, "its spool radius must be above 0, not 0"),
        ({"spool_radius_m": _NAN}, "its spool radius must be above 0, not nan"),
        ({"most_tension_n": 60.0}, "its most tension must be 0.029 to 51 N with this spool"),
        ({"most_tension_n": _NAN}, "its most tension must be 0.029 to 51 N .* not nan N"),
        ({"pretension_n": 21.0}, "its pretension must be 0.029 to 20 N, not 21 N"),
        ({"pretension_n": 0.01}, "its pretension must be 0.029 to 20 N, not 0.01 N"),
        ({"homing_n": 30.0}, "its tension for homing must be 0.029 to 20 N, not 30 N"),
    ],
)
def test_an_invalid_servo_is_refused(changes: dict[str, Any], words: str) -> None:
    """Each invalid value raises an error that names it."""
    with pytest.raises(RobotError, match=words):
        servo("FDP", **changes)


def test_an_unknown_model_suggests_the_nearest() -> None:
    """The error suggests a model with a similar name."""
    with pytest.raises(UnknownName, match="Did you mean 'XL330-M077'"):
        servo("FDP", model="XL330-M77")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"servos": ()}, "needs at least one servo"),
        ({"servos": (servo("FDP"), servo("FDS", id=1))}, "has 2 servos of id 1"),
        ({"servos": (servo("FDP"), servo("FDP", id=2))}, "has 2 servos of name FDP"),
        ({"baud": 12345}, "No servo has 12345 baud; the baud rates are 9600, 57600"),
        ({"watchdog_ms": 0}, "watchdog_ms must be 20 to 2540 in steps of 20, not 0"),
        ({"watchdog_ms": 50}, "watchdog_ms must be 20 to 2540 in steps of 20, not 50"),
        ({"baud": 250_000}, "No servo has 250000 baud"),
        (
            {"servos": (servo("FDP"), feetech("FDS"))},
            "cannot have Dynamixel and Feetech servos",
        ),
        ({"servos": (feetech("FDP"),), "baud": 4_000_000}, "No servo has 4000000 baud; .* 38400"),
    ],
)
def test_an_invalid_bus_is_refused(changes: dict[str, Any], words: str) -> None:
    """Each invalid value raises an error, including a disabled watchdog."""
    with pytest.raises(RobotError, match=words):
        settings(**changes)


def test_the_watchdog_is_on_by_default() -> None:
    """The default watchdog is 100 ms."""
    assert BusSettings("x", (servo("FDP"),)).watchdog_ms == 100


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"control": "tension"},
            "must be 'length', not 'tension', because a Feetech servo has no control of its curren",
        ),
        ({"shortest_m": -0.016}, "its lengths must be within 0.0157 m of the zero, half a turn"),
        ({"longest_m": 0.016}, "its lengths must be within 0.0157 m of the zero, half a turn"),
        ({"id": 254}, "its id must be 0 to 253, not 254"),
        ({"most_tension_n": 400.0}, "its most tension must be 0.38 to 382 N with this spool"),
    ],
)
def test_an_invalid_feetech_servo_is_refused(changes: dict[str, Any], words: str) -> None:
    """What a Feetech servo cannot do is refused in one sentence that says why."""
    with pytest.raises(RobotError, match=words):
        feetech("FDP", **changes)
