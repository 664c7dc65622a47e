"""Outputs: their values from actions, estimates of the applied actions, and `make_safe`."""

from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock, Mock, call

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan, output_values
from shapechanger.errors import RobotError
from shapechanger.robot.guard import outputs
from shapechanger.robot.guard.outputs import OutputBank, estimated, make_safe, preload
from shapechanger.robot.hardware import REAL
from tests.robot.guard.plans import car
from tests.robot.guard.recording import Record, connect

_CAR = GuardPlan(
    "car",
    (ActionPlan("steering", rest=0.1), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("drive", "esc", mix={"throttle": 1.0}),
        OutputPlan("steer", "servo", mix={"steering": -0.5}, offset=0.2),
    ),
)
_TANK = GuardPlan(
    "tank",
    (ActionPlan("steering"), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("left", "hbridge", mix={"throttle": 1.0, "steering": 1.0}),
        OutputPlan("right", "hbridge", mix={"throttle": 1.0, "steering": -1.0}, offset=0.25),
    ),
)


def _pair(driver: str, rest: float = 0.0) -> GuardPlan:
    both = tuple(OutputPlan(name, driver, mix={"lift": 1.0}) for name in ("left", "right"))
    return GuardPlan("crane", (ActionPlan("lift", rest=rest),), both)


_WAITS = "Output {}: its controller waits, brakes or changes direction."
_SLOW = "Output steer: it turns no faster than its profile allows."


@pytest.mark.parametrize(
    ("plan", "asked", "has", "applied", "reason"),
    [
        (_CAR, (0.5, -0.4), (-0.4, -0.05), (0.5, -0.4), ""),
        (_CAR, (0.5, -0.4), (-0.41, -0.04), (0.5, -0.4), ""),
        (_CAR, (0.5, -0.4), (0.0, -0.05), (0.5, 0.0), _WAITS.format("drive")),
        (_CAR, (0.5, -0.4), (-0.4, 0.15), (0.1, -0.4), _SLOW),
        (_CAR, (0.5, -0.4), (-0.4, 0.05), (0.3, -0.4), _SLOW),
        (_CAR, (0.5, -0.4), (0.0, 0.05), (0.3, 0.0), f"{_WAITS.format('drive')} {_SLOW}"),
        # A difference of one pulse step is neither a deviation nor motion.
        (_CAR, (0.1, 0.0), (0.06, 0.15), (0.1, 0.0), ""),
        (_TANK, (0.2, 0.5), (0.06, 0.25), (0.0, 0.0), None),
        # Outputs that mix several actions only show whether the actions rest.
        (_TANK, (0.2, 0.5), (0.0, 0.55), (0.2, 0.5), "Output left: it does not follow."),
        # The value farthest from rest counts.
        (_pair("esc"), (0.5,), (0.5, 0.0), (0.5,), _WAITS.format("right")),
        (_pair("servo"), (0.1,), (-0.8, 0.5), (-0.8,), None),
        (_pair("servo", 0.5), (0.1,), (-0.2, 0.9), (-0.2,), None),
        (_pair("servo", 0.5), (0.1,), (0.55, 0.45), (0.5,), None),
    ],
)
def test_an_action_is_estimated_from_its_outputs(
    plan: GuardPlan,
    asked: tuple[float, ...],
    has: tuple[float, ...],
    applied: tuple[float, ...],
    reason: str | None,
) -> None:
    found, why = estimated(plan, asked, output_values(plan, asked), has)
    assert found == pytest.approx(applied)
    assert reason in (why, None)


def test_an_output_is_its_offset_plus_its_weighted_actions() -> None:
    assert output_values(_TANK, [0.25, 0.5]) == (0.75, 0.5)
    assert output_values(_TANK, [1.0, 1.0]) == (1.0, 0.25)
    for actions in ([], [0.5], [0.0, 0.5, 0.0]):
        with pytest.raises(ValueError, match=r"tank has 2 actions \(steering, throttle\), got "):
            output_values(_TANK, actions)


def test_make_safe_continues_after_a_failed_output(tmp_path: Path) -> None:
    record = Record(tmp_path / "record")
    (tmp_path / "stuck-GPIO17").touch()
    plan = replace(car(), enable_pin=5)
    (failure,) = make_safe(plan, connect(str(record.path)))
    assert failure.startswith("Output steer: ")
    assert {line["pin"] for line in record.pins()} >= {"GPIO22", "GPIO27", "GPIO5"}
    assert record.is_at_rest()
    (tmp_path / "stuck-GPIO17").unlink()
    assert not make_safe(plan, connect(str(record.path)))
    (tmp_path / "stuck-GPIO5").touch()
    assert "Enable pin 5" in make_safe(plan, connect(str(record.path)))[0]


_STUCK = ["Output drive: stuck", "Output steer: stuck"]


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """The drivers of a car's outputs and their servo bus, which record all calls."""
    calls = Mock()
    for driver in (calls.drive, calls.steer):
        driver.device = calls.bus
        driver.write.side_effect = lambda value, _: value
    chip = Mock(differs="it does not follow", stops_itself=False)
    chip.open = lambda output, _: getattr(calls, output.name)
    calls.chips = {"esc": chip, "servo": chip, "bus_servo": Mock(stops_itself=True, open=None)}
    monkeypatch.setattr(outputs, "OUTPUTS", calls.chips)
    return calls


def _done(calls: Mock) -> list[Any]:
    """Return the calls since `_done` was last called."""
    found = list(calls.mock_calls)
    calls.reset_mock()
    return found


def test_outputs_are_written_released_and_closed_together(calls: Mock) -> None:
    bank = OutputBank(_CAR, Mock())
    assert _done(calls) == [call.bus.begin()]  # Both outputs are on one bus.
    assert (bank.values, bank.released) == ({"drive": 0.0, "steer": 0.0}, False)
    assert bank.write((0.4, 0.5), 7) == ((0.4, 0.5), "")
    flush = call.bus.flush(grip=True)
    assert _done(calls) == [call.drive.write(0.5, 7), call.steer.write(0.0, 7), flush]
    assert bank.rest(8) == []
    rest = [call.drive.write(0.0, 8), call.steer.write(pytest.approx(0.15), 8)]
    assert _done(calls) == [*rest, call.bus.flush(grip=False)]
    assert bank.values["steer"] == pytest.approx(0.15)
    for _ in range(2):
        bank.release()
    assert (bank.values, bank.released) == ({"drive": 0.0, "steer": 0.0}, True)
    for energise in (lambda: bank.write((0.4, 0.5), 9), lambda: bank.rest(9)):
        energise()
        assert bank.released is False
        bank.release()
    calls.reset_mock()
    assert bank.close(10) == []  # Released outputs are not energised again.
    assert _done(calls) == [call.drive.close(), call.steer.close()]


def test_each_failure_of_an_output_is_reported(calls: Mock) -> None:
    """`make_safe` also reports outputs that cannot be closed."""
    bank = OutputBank(_CAR, Mock())
    stuck = OSError("stuck")
    for driver in (calls.drive, calls.steer):
        driver.configure_mock(**{"write.side_effect": stuck, "close.side_effect": stuck})
    assert bank.rest(7) == _STUCK
    assert bank.close(8) == _STUCK * 2
    assert calls.drive.write.mock_calls[-1] == call(0.0, 8)
    itself = OutputPlan("arm", "bus_servo", mix={"throttle": 1.0})
    assert make_safe(replace(_CAR, outputs=(itself, *_CAR.outputs)), Mock()) == _STUCK


def test_a_failure_of_a_bus_is_reported(calls: Mock) -> None:
    bank = OutputBank(_CAR, Mock())
    calls.bus.flush.side_effect = OSError("no answer")
    assert bank.rest(7) == ["no answer"]


def test_if_an_output_cannot_be_opened_the_earlier_ones_are_closed(calls: Mock) -> None:
    calls.chips["servo"] = Mock(**{"open.side_effect": OSError("No power.")})
    with pytest.raises(OSError, match="No power"):
        OutputBank(_CAR, Mock())
    assert calls.mock_calls == [call.drive.close()]


def test_the_reason_why_a_bus_is_not_ready_is_returned(calls: Mock) -> None:
    bank, alive = OutputBank(_CAR, Mock()), Mock()
    assert bank.ready(alive) == ""
    calls.bus.ready.assert_called_once_with(alive)
    calls.bus.ready.side_effect = RobotError("servo 3 is hot.")
    assert bank.ready(alive) == "servo 3 is hot."


@pytest.mark.parametrize("source", [REAL, "module:function"])
def test_preload_imports_modules_for_a_stop(monkeypatch: pytest.MonkeyPatch, source: str) -> None:
    """Missing libraries are no failure: a robot without pins may lack them."""
    found = {name: MagicMock() for name in ("load", "OUTPUTS", "PULSES")}
    for name, mock in found.items():
        monkeypatch.setattr(outputs, name, mock)
    imported = Mock(side_effect=ImportError)
    monkeypatch.setattr("importlib.import_module", imported)
    servo = OutputPlan("steer", "servo", settings={"over": "pca9685"})
    preload(GuardPlan("car", (), (OutputPlan("drive", "esc"), servo)), source)
    found["load"].assert_called_once_with(source)
    assert found["OUTPUTS"].__getitem__.mock_calls == [call("esc"), call("servo")]
    found["PULSES"].__getitem__.assert_called_once_with("pca9685")
    of_a_pi = ["shapechanger.robot.lgpio_pins", "gpiozero.pins.lgpio", "smbus2"]
    expected = ["gpiozero", *(of_a_pi if source == REAL else [])]
    assert imported.mock_calls == [call(name) for name in expected]
