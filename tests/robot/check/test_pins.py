"""Pins of a robot, and the test of two that are joined by a wire."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from gpiozero.pins.mock import MockConnectedPin, MockFactory

from shapechanger.contract.plan import GuardPlan, OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.check.pins import check_jumper, plan_of_pins, probed_pin
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.raspberry_pi import RealHardware

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


def test_the_plan_has_each_pin_with_its_position() -> None:
    """A person compares it with the wires."""
    assert plan_of_pins(_PLAN) == [
        "pin          GPIO6 (31): bumper",
        "pin          GPIO13 (33): bumper",
        "pin          GPIO19 (35): enable line",
        "pin          GPIO22 (15): drive forward",
        "pin          GPIO26 (37): the emergency button",
        "pin          GPIO27 (13): drive backward",
    ]


@pytest.mark.parametrize(
    ("kind", "probe", "words"),
    [("car", 27, "used by drive backward"), ("boat", 20, "needs a motor on an H-bridge")],
)
def test_probes_that_cannot_measure(kind: str, probe: int, words: str) -> None:
    """A pin of the robot, and a servo's pulses, which go on at rest."""
    with pytest.raises(RobotError, match=words):
        probed_pin(load_profile(find_profile(kind)).guard_plan(), probe)
    assert probed_pin(load_profile(find_profile("tank")).guard_plan(), 20) == 17
