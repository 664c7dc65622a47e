"""Validation of bus and servo settings."""

import math
from collections.abc import Callable
from typing import Any, get_args

import pytest

from shapechanger.robot.drivers.chip import KeyMistake
from shapechanger.robot.drivers.servos.family import MODELS, ModelName
from shapechanger.robot.drivers.servos.settings import BusSettings
from tests.robot.drivers.servos.rigs import feetech, servo, settings


@pytest.mark.parametrize(
    ("make", "changes", "words"),
    [
        (servo, {"id": 253}, "must be 0 to 252, not 253"),
        (servo, {"most_tension_n": 60.0}, "must be 0.029 to 51 N with this spool"),
        (servo, {"most_tension_n": math.nan}, "must be 0.029 to 51 N .* not nan N"),
        (servo, {"pretension_n": 21.0}, "must be 0.029 to 20 N, not 21 N"),
        (servo, {"pretension_n": 0.01}, "must be 0.029 to 20 N, not 0.01 N"),
        (servo, {"homing_n": 30.0}, "must be 0.029 to 20 N, not 30 N"),
        (
            feetech,
            {"control": "tension"},
            "must be 'length', not 'tension', because a Feetech servo has no control of its curren",
        ),
        (feetech, {"shortest_m": -0.016}, "must be within 0.0157 m of the zero, half a turn"),
        (feetech, {"longest_m": 0.016}, "must be within 0.0157 m of the zero, half a turn"),
        (feetech, {"most_tension_n": 400.0}, "must be 0.38 to 382 N with this spool"),
    ],
)
def test_what_a_servo_cannot_do_is_refused(
    make: Callable[..., object], changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(KeyMistake, match=words) as caught:
        make("FDP", **changes)
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
    with pytest.raises(KeyMistake, match=words) as caught:
        settings(**changes)
    assert caught.value.key == key


def test_the_watchdog_is_on_by_default() -> None:
    assert BusSettings(device="x", servos=(servo("FDP"),)).watchdog_ms == 100


def test_the_models_are_those_of_the_table() -> None:
    """A profile takes the names of `servos.toml`."""
    assert get_args(ModelName) == tuple(MODELS)
