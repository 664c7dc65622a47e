"""The self-test of two pins joined by a wire."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from gpiozero.pins.mock import MockConnectedPin, MockFactory

from shapechanger.cli.robot.checks import check_jumper
from shapechanger.errors import RobotError
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan, SensorPlan
from shapechanger.robot.hardware import RealHardware

_PLAN = GuardPlan(
    "car",
    (),
    (OutputPlan("drive", "hbridge", settings={"forward": 22, "backward": 27, "enable": -1}),),
    (SensorPlan("bumper", "switch", "bump", {"pins": [6, 13]}),),
    enable_pin=19,
    stop_pin=26,
)


class _Pins(RealHardware):
    """gpiozero's mock pins; 20 and 21 are joined, 20 and 16 are not."""

    def __init__(self) -> None:
        super().__init__()
        self.factory: Any = MockFactory()
        joined = self.factory.pin(21, pin_class=MockConnectedPin)
        joined.input_pin = self.factory.pin(20)

    def pin_factory(self) -> Any:
        return self.factory


@pytest.fixture
def pins() -> Iterator[_Pins]:
    """Fake pins."""
    made = _Pins()
    yield made
    made.factory.close()


def test_joined_pins_pass(pins: _Pins) -> None:
    """The input follows the output."""
    assert "20 followed pin 21" in check_jumper(21, 20, _PLAN, pins)


def test_pins_without_a_wire_fail(pins: _Pins) -> None:
    """The error asks for the wire."""
    with pytest.raises(RobotError, match="is the wire between them"):
        check_jumper(21, 16, _PLAN, pins)


@pytest.mark.parametrize(
    ("pair", "user"),
    [((22, 20), "drive"), ((20, 6), "bumper"), ((19, 20), "enable line"), ((20, 26), "button")],
)
def test_pins_of_the_robot_are_never_toggled(pair: tuple[int, int], user: str) -> None:
    """Pins in use are refused, so that the test cannot start a motor."""
    with pytest.raises(RobotError, match=user):
        check_jumper(*pair, _PLAN)
