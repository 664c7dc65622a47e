"""Two pins that are joined by a wire, before a robot is tried."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from gpiozero.pins.mock import MockConnectedPin, MockFactory

from shapechanger.cli.robot.selftest import check_jumper
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
    """Pins of gpiozero's own fake; 20 and 21 are joined, 20 and 16 are not."""

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


def test_an_input_follows_the_output_that_it_is_joined_to(pins: _Pins) -> None:
    """Then the pins work, and so does what drives them."""
    assert "20 followed pin 21" in check_jumper(21, 20, _PLAN, pins)


def test_without_a_wire_it_does_not(pins: _Pins) -> None:
    """The check can fail."""
    with pytest.raises(RobotError, match="is the wire between them"):
        check_jumper(21, 16, _PLAN, pins)


@pytest.mark.parametrize(
    ("pair", "user"),
    [((22, 20), "drive"), ((20, 6), "bumper"), ((19, 20), "enable line"), ((20, 26), "button")],
)
def test_pins_of_the_robot_are_never_toggled(pair: tuple[int, int], user: str) -> None:
    """A self-test must not start a motor."""
    with pytest.raises(RobotError, match=user):
        check_jumper(*pair, _PLAN)
