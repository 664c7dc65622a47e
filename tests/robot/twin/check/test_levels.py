"""The levels of a check, and the bench of LEDs as a whole on a twin."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import pytest

from shapechanger.cli import main
from shapechanger.errors import RobotError
from shapechanger.robot.check.check import Finding
from shapechanger.robot.check.wiring import StandingRobot
from shapechanger.robot.twin.check.bench import Bench, Watcher
from shapechanger.robot.twin.check.faults import FAULTS
from shapechanger.robot.twin.check.trial import (
    Trial,
    TrialResult,
    check_robot,
    fault_checks,
    require_level,
)
from tests.robot.check.held_pins import shipped


class _Trial(Trial):
    """Trials with results of their own."""

    def __init__(self, kind: str, *results: TrialResult | RobotError, trials: int = 1) -> None:
        super().__init__(shipped(kind), trials=trials)
        self._given = list(results)

    def run(self, fault: object) -> TrialResult:
        """Return the next result."""
        del fault
        result = self._given.pop(0)
        if isinstance(result, RobotError):
            raise result
        return result


def _result(stopped_ms: float, *, drove: bool = True, answer: bool | None = None) -> TrialResult:
    return TrialResult("driver killed", stopped_ms, 270.0, drove, (), answer)


_VOID = _result(0.0, drove=False)


@pytest.mark.parametrize(
    ("results", "level", "sentence"),
    [
        ([_result(251.0)], "good", "At rest 251 ms later; 270 ms are promised."),
        ([_result(271.0)], "bad", "At rest 271 ms later; 270 ms are promised."),
        ([_result(math.inf)], "bad", "At rest never; 270 ms are promised."),
        ([_VOID, _result(251.0)], "good", "At rest 251 ms later; 270 ms are promised."),
        ([_VOID, _VOID, _VOID], "bad", "It did not drive before the fault."),
        ([RobotError("The driver did not drive.")], "bad", "The driver did not drive."),
        ([_result(math.nan, answer=True)], "good", "The LEDs were lit, and then out."),
        ([_result(math.nan, answer=False)], "bad", "NOT lit, or NOT out afterwards."),
        (
            [_result(math.nan)],
            "unknown",
            "Not measured: a wire to a free pin does, with --probe; 270 ms are promised.",
        ),
    ],
)
def test_a_fault_is_a_check(
    results: list[TrialResult | RobotError], level: str, sentence: str
) -> None:
    """It is good only where the stop was in time, and was measured or seen."""
    found = _Trial("car", *results).results(FAULTS["driver killed"])
    assert list(found) == [(level, sentence)]


def test_trials_of_one_fault_are_one_finding() -> None:
    """One late stop among them is bad."""
    trial = _Trial("car", _result(200.0), _result(300.0), _result(210.0), trials=3)
    ((level, sentence),) = trial.results(FAULTS["driver killed"])
    assert level == "bad"
    assert sentence.startswith("At rest 210 ms later, and at most 300 ms in 3 trials; 270")


def test_faults_need_parts_of_a_robot() -> None:
    """A bench lets those happen that need no board of a twin."""
    trial = Trial(shipped("car"))
    assert not trial.lacks("")
    assert trial.lacks("bumper") == "This robot has no bumper."
    assert Trial(shipped("finger")).lacks("throttle") == "This robot has no throttle."
    assert [check.name for check in fault_checks(trial, all_faults=True)] == list(FAULTS)
    needs = {FAULTS[check.name].needs for check in fault_checks(trial, all_faults=False)}
    assert needs == {"", "one-shot"}


@pytest.mark.parametrize(
    ("level", "words"),
    [("leds", "an LED cannot stand for it"), ("faults", "there is nothing to stop")],
)
def test_levels_that_a_robot_cannot_have(level: Literal["leds", "faults"], words: str) -> None:
    """They are refused before anything starts."""
    trial = Trial(shipped("finger"))
    with pytest.raises(RobotError, match=words):
        require_level(level, trial)


def test_a_part_is_named_before_its_questions(monkeypatch: pytest.MonkeyPatch) -> None:
    """The heading comes when nothing was asked or opened yet, and each part ends at rest."""
    bench = Bench(shipped("car"))
    events: list[str] = []

    def walked(*_: object) -> Iterator[Finding]:
        events.append("lit")
        yield Finding("LED GPIO22", "good", "lit.")

    def closed() -> list[str]:
        events.append("closed")
        return ["GPIO22 burns."]

    monkeypatch.setattr("shapechanger.robot.twin.check.trial.walk", walked)
    monkeypatch.setattr("shapechanger.robot.twin.check.trial.examine", lambda _: iter(()))
    monkeypatch.setattr(bench, "watcher", Watcher)
    monkeypatch.setattr(bench, "close", closed)
    parts = check_robot("leds", Trial(bench), StandingRobot(bench.plan), 0.2)
    assert next(parts)[0] == "wiring"
    part, findings = next(parts)
    assert (part, events) == ("LEDs", [])
    assert [one.check for one in findings] == ["LED GPIO22", "safe pins"]
    assert events == ["lit", "closed"]


@pytest.mark.realtime
@pytest.mark.system
def test_the_bench_of_a_twin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """LEDs, checks and faults run as on a Pi, judged by the ledger, and end in one report."""
    monkeypatch.chdir(tmp_path)
    # A busy machine may be late, which is not what this test is about.
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
    assert text.strip().endswith("not measured.")
    assert "wrote leds-report.txt" in capsys.readouterr().out
