"""LEDs in place of a robot's motors, on simulated pins."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.robot.check.check import Finding
from shapechanger.robot.check.pins import lamps_of, walk
from tests.robot.check.held_pins import HeldPins, shipped


@pytest.fixture
def pins() -> Iterator[HeldPins]:
    made = HeldPins()
    yield made
    made.factory.close()


def _walked(
    plan: GuardPlan, pins: HeldPins, ask: Callable[[str], bool | None]
) -> dict[str, Finding]:
    found = walk(plan, lambda: pins, ask, lambda _: None, shown_s=0.0)
    return {one.check: one for one in found}


@pytest.mark.parametrize(
    ("kind", "places"),
    [
        ("car", ["GPIO22", "GPIO27", "GPIO4", "GPIO17", "GPIO19"]),
        ("tank", [f"GPIO{pin}" for pin in (17, 27, 22, 23, 24, 25)]),
        ("boat", ["GPIO18", "GPIO12"]),
        ("truck", [f"channel {number} of the pca9685" for number in range(4)]),
    ],
)
def test_each_output_has_its_leds(kind: str, places: list[str]) -> None:
    """A motor has one for each direction, and one for its enable input."""
    assert [lamp.place for lamp in lamps_of(shipped(kind).guard_plan())] == places


def test_a_servo_bus_takes_no_leds() -> None:
    """The error names a robot that does."""
    with pytest.raises(RobotError, match=r"servo on a bus .*`init car`"):
        lamps_of(shipped("finger").guard_plan())


def test_each_led_is_lit_alone(pins: HeldPins) -> None:
    """The person is asked while it is lit; all are out at the end."""
    plan = shipped("car").guard_plan()
    numbers = [22, 27, 4, 17, 19]
    seen: list[list[int]] = []

    def ask(question: str) -> bool:
        lit = [n for n in numbers if pins.factory.pin(n).state]
        seen.append(lit)
        assert f"GPIO{lit[0]} lit" in question
        return lit != [4]

    found = _walked(plan, pins, ask)
    assert seen == [[n] for n in numbers]
    assert not any(pins.factory.pin(n).state for n in numbers)
    assert {name for name, one in found.items() if one.level == "bad"} == {"LED GPIO4"}
    assert found["LED GPIO4"].sentence == "steer forward: NOT lit."


def test_unanswered_leds_are_not_measured(pins: HeldPins) -> None:
    """They are neither good nor bad."""
    found = _walked(shipped("car").guard_plan(), pins, lambda _: None)
    assert {one.level for one in found.values()} == {"unknown"}


def test_a_missing_servo_board_does_not_end_the_walk(
    pins: HeldPins, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of its channels is reported."""

    def no_bus(_: int) -> None:
        raise OSError(121, "Remote I/O error")

    monkeypatch.setattr(pins, "i2c", no_bus)
    found = _walked(shipped("truck").guard_plan(), pins, lambda _: None)
    assert [one.level for one in found.values()] == ["bad"] * 4
    assert "does not answer" in found["LED channel 0 of the pca9685"].sentence
