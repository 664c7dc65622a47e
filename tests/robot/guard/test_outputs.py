"""Outputs: mixed from actions, estimated back from deviations, and made safe."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

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
    (ActionPlan("steering", propels=True), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("left", "hbridge", mix={"throttle": 1.0, "steering": 1.0}),
        OutputPlan("right", "hbridge", mix={"throttle": 1.0, "steering": -1.0}),
    ),
)
_WAITS = "Output drive: its controller waits, brakes or changes direction."
_SLOW = "Output steer: it turns no faster than its profile allows."


@pytest.mark.parametrize(
    ("has", "actions", "reason"),
    [
        ((-0.4, -0.05), (0.5, -0.4), ""),
        ((-0.41, -0.04), (0.5, -0.4), ""),
        ((0.0, -0.05), (0.5, 0.0), _WAITS),
        ((-0.4, 0.15), (0.1, -0.4), _SLOW),
        ((-0.4, 0.05), (0.3, -0.4), _SLOW),
        ((0.0, 0.05), (0.3, 0.0), f"{_WAITS} {_SLOW}"),
    ],
)
def test_an_action_is_estimated_from_its_output(
    has: tuple[float, float], actions: tuple[float, float], reason: str
) -> None:
    applied, why = estimated(_CAR, (0.5, -0.4), (-0.4, -0.05), has)
    assert applied == pytest.approx(actions)
    assert why == reason


def test_mixed_outputs_show_rest_only() -> None:
    assert estimated(_TANK, (0.2, 0.5), (0.7, 0.3), (0.0, 0.0))[0] == (0.0, 0.0)
    one = estimated(_TANK, (0.2, 0.5), (0.7, 0.3), (0.0, 0.3))
    assert one == ((0.2, 0.5), "Output left: it does not follow.")


def test_an_action_with_two_outputs_is_active_while_one_moves() -> None:
    boat = GuardPlan(
        "boat",
        (ActionPlan("throttle", propels=True),),
        tuple(OutputPlan(name, "esc", mix={"throttle": 1.0}) for name in ("left", "right")),
    )
    done = estimated(boat, (0.5,), (0.5, 0.5), (0.5, 0.0))
    assert done == ((0.5,), _WAITS.replace("drive", "right"))


_OFFSET = GuardPlan(
    "tank",
    (ActionPlan("steering"), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("left", "hbridge", mix={"throttle": 1.0, "steering": 1.0}),
        OutputPlan("right", "hbridge", mix={"throttle": 1.0, "steering": -1.0}, offset=0.25),
    ),
)


def test_an_output_is_its_offset_plus_its_weighted_actions() -> None:
    assert output_values(_OFFSET, [0.25, 0.5]) == (0.75, 0.5)
    assert output_values(_OFFSET, [1.0, 1.0]) == (1.0, 0.25)


@pytest.mark.parametrize("actions", [[], [0.5], [0.0, 0.5, 0.0]])
def test_a_wrong_number_of_actions_is_refused(actions: list[float]) -> None:
    with pytest.raises(ValueError, match=r"tank has 2 actions \(steering, throttle\), got "):
        output_values(_OFFSET, actions)


def test_make_safe_continues_after_a_failed_output(tmp_path: Path) -> None:
    record = Record(tmp_path / "record")
    (tmp_path / "stuck-GPIO17").touch()
    plan = replace(car(), enable_pin=5)
    failures = make_safe(plan, connect(str(record.path)))
    assert len(failures) == 1
    assert failures[0].startswith("Output steer: ")
    assert {line["pin"] for line in record.pins()} >= {"GPIO22", "GPIO27", "GPIO5"}
    assert record.is_at_rest()
    (tmp_path / "stuck-GPIO17").unlink()
    assert not make_safe(plan, connect(str(record.path)))
    (tmp_path / "stuck-GPIO5").touch()
    assert "Enable pin 5" in make_safe(plan, connect(str(record.path)))[0]


@pytest.mark.parametrize(
    ("rest", "has", "applied"),
    [
        (0.0, (-0.8, 0.5), -0.8),
        (0.5, (-0.2, 0.9), -0.2),
        (0.5, (0.55, 0.45), 0.5),  # Within a step of rest.
    ],
)
def test_an_action_of_several_outputs_has_the_value_farthest_from_rest(
    rest: float, has: tuple[float, float], applied: float
) -> None:
    outputs = tuple(OutputPlan(name, "servo", mix={"lift": 1.0}) for name in ("left", "right"))
    plan = GuardPlan("crane", (ActionPlan("lift", rest=rest),), outputs)
    assert estimated(plan, (0.1,), (0.1, 0.1), has)[0] == (applied,)


def test_a_step_is_no_deviation() -> None:
    assert estimated(_CAR, (0.0, 0.0), (0.0, 0.0), (0.06, 0.0)) == ((0.0, 0.0), "")
    assert estimated(_OFFSET, (0.2, 0.5), (0.7, 0.3), (0.06, 0.25))[0] == (0.0, 0.0)


class _Driver:
    """A driver that records its calls, and may fail."""

    def __init__(self, name: str, calls: list[tuple[object, ...]], device: object) -> None:
        self._name, self._calls, self.device = name, calls, device
        self.error: Exception | None = None

    def write(self, value: float, now_ns: int) -> float:
        self._call("write", value, now_ns)
        return value

    def release(self) -> None:
        self._call("release")

    def close(self) -> None:
        self._call("close")

    def _call(self, *call: object) -> None:
        self._calls.append((self._name, *call))
        if self.error is not None:
            raise self.error


class _Bus:
    """A servo bus that records its calls."""

    def __init__(self, calls: list[tuple[object, ...]], problem: str = "") -> None:
        self._calls, self._problem = calls, problem

    def begin(self) -> None:
        self._calls.append(("bus", "begin"))

    def flush(self, *, grip: bool) -> None:
        self._calls.append(("bus", "flush", grip))

    def ready(self, alive: Callable[[], object]) -> None:
        alive()
        if self._problem:
            raise RobotError(self._problem)


@pytest.fixture
def opening(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Open a bank of two outputs of a car on recorded drivers."""

    def opened(calls: list[tuple[object, ...]], bus: object, broken: str = "") -> Any:
        def one(output: OutputPlan, hardware: object) -> _Driver:
            assert hardware == "hardware"
            if output.name == broken:
                raise OSError("No power.")
            return _Driver(output.name, calls, bus)

        chip = SimpleNamespace(open=one, differs="it does not follow")
        monkeypatch.setattr(outputs, "OUTPUTS", {"esc": chip, "servo": chip})
        return OutputBank(_CAR, "hardware")

    return opened


def test_outputs_are_written_released_and_closed_together(opening: Callable[..., Any]) -> None:
    calls: list[tuple[object, ...]] = []
    bank = opening(calls, _Bus(calls))
    assert calls == [("bus", "begin")]  # Both outputs are on one bus.
    assert (bank.values, bank.released) == ({"drive": 0.0, "steer": 0.0}, False)
    calls.clear()
    assert bank.write((0.4, 0.5), 7) == ((0.4, 0.5), "")
    assert calls == [("drive", "write", 0.5, 7), ("steer", "write", 0.0, 7), ("bus", "flush", True)]
    calls.clear()
    assert bank.rest(8) == []
    assert calls == [
        ("drive", "write", 0.0, 8),
        ("steer", "write", 0.15000000000000002, 8),
        ("bus", "flush", False),
    ]
    assert bank.values["steer"] == 0.15000000000000002
    calls.clear()
    bank.release()
    bank.release()
    assert (bank.values, bank.released) == ({"drive": 0.0, "steer": 0.0}, True)
    bank.write((0.4, 0.5), 9)
    assert bank.released is False
    bank.release()
    bank.rest(9)
    assert bank.released is False
    calls.clear()
    bank.release()
    assert bank.close(10) == []  # What is released is not energised again.
    assert [call[1] for call in calls] == ["release"] * 2 + ["close"] * 2


def test_each_failure_of_an_output_is_reported(opening: Callable[..., Any]) -> None:
    calls: list[tuple[object, ...]] = []
    bank = opening(calls, None)
    for _, driver in bank._drivers:
        driver.error = OSError("stuck")
    assert bank.rest(7) == ["Output drive: stuck", "Output steer: stuck"]
    calls.clear()
    assert bank.close(8) == ["Output drive: stuck", "Output steer: stuck"] * 2
    assert [call[1:] for call in calls[:1]] == [("write", 0.0, 8)]


def test_an_output_that_cannot_be_opened_closes_those_before(opening: Callable[..., Any]) -> None:
    calls: list[tuple[object, ...]] = []
    with pytest.raises(OSError, match="No power"):
        opening(calls, None, broken="steer")
    assert calls == [("drive", "close")]


def test_a_bus_tells_why_it_is_not_ready(opening: Callable[..., Any]) -> None:
    alive: list[object] = []
    bank = opening([], _Bus([], "servo 3 is hot."))
    assert bank.ready(lambda: alive.append("alive")) == "servo 3 is hot."
    assert alive == ["alive"]
    assert opening([], _Bus([])).ready(lambda: None) == ""


def test_a_safe_robot_reports_outputs_that_do_not_close(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[tuple[object, ...]] = []
    driver = _Driver("any", calls, None)
    driver.error = OSError("stuck")
    chips = {
        "esc": SimpleNamespace(open=lambda *_: driver, stops_itself=False),
        "servo": SimpleNamespace(open=lambda *_: driver, stops_itself=False),
        "bus_servo": SimpleNamespace(stops_itself=True),
    }
    monkeypatch.setattr(outputs, "OUTPUTS", chips)
    itself = OutputPlan("arm", "bus_servo", mix={"throttle": 1.0})
    plan = replace(_CAR, outputs=(itself, *_CAR.outputs))
    assert make_safe(plan, SimpleNamespace()) == ["Output drive: stuck", "Output steer: stuck"]


@pytest.mark.parametrize("source", [REAL, "twin:hardware"])
def test_everything_to_make_outputs_safe_is_imported(
    monkeypatch: pytest.MonkeyPatch, source: str
) -> None:
    """Drivers, pulses, the source of the hardware, and the libraries that are there."""
    found: list[str] = []

    class Table(dict[str, None]):
        def __missing__(self, name: str) -> None:
            found.append(name)

    def library(name: str) -> None:
        found.append(name)
        raise ImportError

    monkeypatch.setattr(outputs, "OUTPUTS", Table())
    monkeypatch.setattr(outputs, "PULSES", Table())
    monkeypatch.setattr(outputs, "load", found.append)
    monkeypatch.setattr("importlib.import_module", library)
    over = OutputPlan("arm", "servo", settings={"over": "pca9685"})
    preload(replace(_CAR, outputs=(_CAR.outputs[0], over)), source)
    real = ["shapechanger.robot.lgpio_pins", "gpiozero.pins.lgpio", "smbus2"]
    assert found == [
        source,
        "esc",
        "servo",
        "pca9685",
        "gpiozero",
        *(real if source == REAL else []),
    ]
