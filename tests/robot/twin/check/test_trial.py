"""Trials of faults, their findings, and the levels of a check."""

import contextlib
import math
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest

from shapechanger.cli import main
from shapechanger.errors import RobotError
from shapechanger.robot.check.pins import lamps_of
from shapechanger.robot.twin.check import trial as module
from shapechanger.robot.twin.check.faults import FAULTS, Fault
from shapechanger.robot.twin.check.trial import Bench, TrialResult, Watcher, fault_finding
from tests.robot.check.held_pins import HeldPins, shipped


def test_a_probe_measures_the_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stop is measured at the last edge; a pin that stays high never stops."""
    now_ns = 0
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns)
    pins, car = HeldPins(), shipped("car")
    monkeypatch.setattr(module, "Hardware", lambda: pins)
    watcher = Bench(car, twin=False, probe=20).watcher()
    wire = pins.factory.pin(20)
    now_ns = 1_000_000_000
    assert watcher.rest_ms(now_ns) == 0.0
    wire.drive_high()
    assert watcher.moves()
    assert math.isinf(watcher.rest_ms(now_ns))
    now_ns += 30_000_000
    wire.drive_low()
    assert watcher.moves()
    assert watcher.rest_ms(1_000_000_000) == 30.0
    assert watcher.rest_ms(2_000_000_000) == 0.0
    now_ns += 50_000_000
    assert not watcher.moves()
    assert [watcher.sees(lamp) for lamp in lamps_of(car)[:2]] == [False, None]
    watcher.close()


def _result(stopped_ms: float, answer: bool | None = None) -> TrialResult:
    return TrialResult(stopped_ms, 270.0, True, answer=answer)


_VOID = TrialResult(0.0, 270.0, False)


@pytest.mark.parametrize(
    ("results", "level", "part"),
    [
        ([_result(251.0)], "good", "At rest 251 ms later; 270 ms are promised."),
        ([_result(271.0)], "bad", "At rest 271 ms later"),
        ([_result(math.inf)], "bad", "At rest never"),
        ([_VOID, _result(251.0)], "good", "At rest 251 ms later"),
        ([_VOID, _VOID, _VOID], "bad", "It did not drive before the fault."),
        ([_result(200.0), _VOID, _result(300.0), _result(210.0)], "bad", "at most 300 ms in 3 tri"),
        ([RobotError("The driver did not drive.")], "bad", "The driver did not drive."),
        ([_result(math.nan, answer=True)], "good", "The LEDs were lit, and then out."),
        ([_result(math.nan, answer=False)], "bad", "NOT lit, or NOT out afterwards."),
        ([_result(math.nan)], "unknown", "Not measured: join the motor's pin to a free"),
    ],
)
def test_the_finding_of_a_fault(
    monkeypatch: pytest.MonkeyPatch, results: list[Any], level: str, part: str
) -> None:
    """A finding is good only if each stop was in time, and was measured or seen by a person."""
    monkeypatch.setattr(module, "_try", MagicMock(side_effect=results))
    trials = sum(result is not _VOID for result in results) or 1
    found, sentence = fault_finding(Bench(shipped("car")), FAULTS["driver killed"], trials)
    assert (found, part in sentence) == (level, True)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A bench on pins with fakes of robot, driver and network; `events` has their calls."""
    events: list[str] = []
    robot: Any = SimpleNamespace(port=1, known_at=lambda _: None)
    robot.client = lambda **_: nullcontext(MagicMock())
    driver = SimpleNamespace(sent=[], await_commands=lambda _: None)
    for name in ("SHOWN_S", "_STAYS_S", "_DRIVES_S"):
        monkeypatch.setattr(module, name, 0.0)
    monkeypatch.setattr(module, "BadNetwork", lambda port: SimpleNamespace(port=port, close=int))
    monkeypatch.setattr(module, "Driver", lambda *_, **__: nullcontext(driver))
    made: Any = Bench(shipped("car"), twin=False)
    made.robot = robot
    made.watcher = Watcher
    made.close = lambda: events.append("closed") or []
    made.events = events
    return made


def _fault(bench: Any) -> Fault:
    def make(_: object) -> int:
        bench.events.append("fault")
        return 0

    return Fault("guard and supervisor killed", make, 1.0, then="is gone", needs="one-shot")


def test_a_person_is_asked_before_the_pins_are_made_safe(bench: Any) -> None:
    """Closing the bench would also switch off an LED that had stayed lit."""

    def ask(question: str) -> bool:
        bench.events.append(question)
        return False

    bench.ask = ask
    found = fault_finding(bench, _fault(bench), 1)
    assert found == ("bad", "NOT lit, or NOT out afterwards.")
    assert bench.events == [
        "fault",
        "Did a motor's LED light up, and are all of them out now (guard and supervisor killed)?",
        "closed",
    ]


def test_pins_that_stay_driven_are_bad(bench: Any) -> None:
    bench.close = MagicMock(side_effect=[["GPIO22 is stuck."], []])
    found = fault_finding(bench, _fault(bench), 1)
    assert found == ("bad", "Not everything is at rest: GPIO22 is stuck.")


@pytest.mark.realtime
@pytest.mark.system
def test_the_bench_of_a_twin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """LEDs, checks and faults run as on a Pi, are evaluated from the ledger, and are reported."""
    monkeypatch.chdir(tmp_path)
    # A busy machine may be late, which this test does not check.
    with contextlib.suppress(SystemExit):
        main(["robot", "check", "car", "--twin", "--leds"])
    (report,) = tmp_path.iterdir()
    text = report.read_text()
    assert report.name == "leds-report.txt"
    for part in ("wiring", "LEDs", "driving", "faults"):
        assert f"\n\n{part}\n" in text
    for place in ("GPIO22", "GPIO27", "GPIO4", "GPIO17", "GPIO19"):
        assert f"good  LED {place}: " in text
    for name, fault in FAULTS.items():
        assert (f"  {name}: At rest " in text) == fault.on_pins
    assert "At rest never" not in text
    assert "without an encoder, it is unknown whether the wheels did" in text
    assert text.strip().endswith("not measured.")
    assert "wrote leds-report.txt" in capsys.readouterr().out
