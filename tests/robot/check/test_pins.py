"""Pins of a robot: a wire between two free ones, the pin to probe, LEDs instead of motors."""

from collections.abc import Callable, Iterator

import pytest
from gpiozero.pins.mock import MockConnectedPin, MockPin

from shapechanger.contract.plan import GuardPlan, OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.check.pins import check_jumper, check_lamps, probed_pin
from shapechanger.robot.check.report import Finding
from tests.robot.check.held_pins import HeldPins, shipped

_PLAN = GuardPlan(
    "car",
    (),
    (OutputPlan("drive", "hbridge", settings={"forward": 22, "backward": 27, "enable": -1}),),
    (SensorPlan("bumper", "switch", "bump", {"pins": [6, 13]}),),
    enable_pin=19,
    stop_pin=26,
)


@pytest.fixture
def pins() -> Iterator[HeldPins]:
    made = HeldPins()
    yield made
    made.factory.close()


def test_only_joined_pins_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    pins = HeldPins(MockPin)
    monkeypatch.setattr("shapechanger.robot.check.pins.Hardware", lambda: pins)
    joined = pins.factory.pin(21, pin_class=MockConnectedPin)
    joined.input_pin = pins.factory.pin(20)
    assert "20 followed pin 21" in check_jumper(21, 20, _PLAN)
    with pytest.raises(RobotError, match="is the wire between them"):
        check_jumper(21, 16, _PLAN)


@pytest.mark.parametrize(
    ("pair", "user"),
    [((22, 20), "drive"), ((20, 6), "bumper"), ((19, 20), "enable line"), ((20, 26), "button")],
)
def test_pins_of_the_robot_are_never_toggled(pair: tuple[int, int], user: str) -> None:
    """The test of a wire refuses pins of the robot, so it cannot start a motor."""
    with pytest.raises(RobotError, match=user):
        check_jumper(*pair, _PLAN)


def test_probes_that_cannot_measure_are_refused() -> None:
    """A probe needs a free pin, and an output whose pin is low at rest."""
    with pytest.raises(RobotError, match="used by drive backward"):
        probed_pin(shipped("car"), 27)
    with pytest.raises(RobotError, match="needs a motor on an H-bridge"):
        probed_pin(shipped("boat"), 20)
    assert probed_pin(shipped("tank"), 20) == 17


def _lit(kind: str, pins: HeldPins, ask: Callable[[str], bool | None]) -> dict[str, Finding]:
    checks = check_lamps(shipped(kind), lambda: pins, ask, lambda _: None, shown_s=0.0)
    return {one.check: one for one in checks}


def test_each_led_is_lit_alone(pins: HeldPins) -> None:
    numbers = [22, 27, 4, 17, 19]
    seen: list[list[int]] = []

    def ask(question: str) -> bool:
        lit = [n for n in numbers if pins.factory.pin(n).state]
        seen.append(lit)
        assert f"GPIO{lit[0]} lit" in question
        return lit != [4]

    found = _lit("car", pins, ask)
    assert seen == [[n] for n in numbers]
    assert not any(pins.factory.pin(n).state for n in numbers)
    assert {name for name, one in found.items() if one.level == "bad"} == {"LED GPIO4"}
    assert found["LED GPIO4"].sentence == "steer forward: NOT lit."
    assert {one.level for one in _lit("car", pins, lambda _: None).values()} == {"unknown"}


def test_a_missing_servo_board_does_not_end_the_checks(
    pins: HeldPins, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_bus(_: int) -> None:
        raise OSError(121, "Remote I/O error")

    monkeypatch.setattr(pins, "i2c", no_bus)
    found = _lit("truck", pins, lambda _: None)
    assert [one.level for one in found.values()] == ["bad"] * 4
    assert "does not answer" in found["LED channel 0 of the pca9685"].sentence
