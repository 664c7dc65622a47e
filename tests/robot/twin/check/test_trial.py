"""Trials on pins, where a person or a probe sees what a twin's ledger would have."""

from __future__ import annotations

import math
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from shapechanger.robot.twin.check import trial as module
from shapechanger.robot.twin.check.bench import Bench, Watcher
from shapechanger.robot.twin.check.faults import Fault
from shapechanger.robot.twin.check.trial import Trial
from tests.robot.check.held_pins import shipped


class _Stopped(Watcher):
    """A probe that saw the output stop at once."""

    def moves(self) -> bool:
        return False

    def rest_ms(self, at_ns: int) -> float:
        return 7.0


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A bench on pins whose robot, driver and network are none; `events` has what it does."""
    events: list[str] = []
    robot: Any = SimpleNamespace(port=1, known_at=lambda _: None)
    driver = SimpleNamespace(sent=[], await_commands=lambda _: None)
    for name in ("SHOWN_S", "_STAYS_S", "_DRIVES_S"):
        monkeypatch.setattr(module, name, 0.0)
    monkeypatch.setattr(module, "_calm", lambda _: None)
    monkeypatch.setattr(module, "BadNetwork", lambda port: nullcontext(SimpleNamespace(port=port)))
    monkeypatch.setattr(module, "Driver", lambda *_, **__: nullcontext(driver))
    made: Any = Bench(shipped("car"), twin=False)
    monkeypatch.setattr(made, "robot", lambda: robot)
    monkeypatch.setattr(made, "watcher", Watcher)
    monkeypatch.setattr(made, "close", lambda: events.append("closed") or [])
    made.events = events
    return made


def _fault(events: list[str]) -> Fault:
    def make(_: object) -> int:
        events.append("fault")
        return 0

    return Fault("guard and supervisor killed", make, 1.0, then="is gone", needs="one-shot")


def test_a_person_is_asked_before_the_pins_are_made_safe(bench: Any) -> None:
    """Whatever makes them safe would also put out an LED that stayed lit."""
    events: list[str] = bench.events

    def ask(question: str) -> bool:
        events.append(question)
        return False

    trial = Trial(bench, ask=ask)
    assert list(trial.results(_fault(events))) == [("bad", "NOT lit, or NOT out afterwards.")]
    assert events == [
        "fault",
        "Did a motor's LED light up, and are all of them out now (guard and supervisor killed)?",
        "closed",
    ]


def test_a_probe_is_asked_first(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it never saw the motor driven, the trial is void."""
    monkeypatch.setattr(bench, "watcher", _Stopped)
    asked: list[str] = []
    result = Trial(bench, ask=asked.append).run(_fault(bench.events))
    assert (result.stopped_ms, result.drove, result.kept, asked) == (7.0, False, False, [])


def test_nobody_sees_the_stop(bench: Any) -> None:
    result = Trial(bench).run(_fault(bench.events))
    assert math.isnan(result.stopped_ms)
    assert not result.kept


def test_pins_that_stay_driven_are_bad(bench: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The finding names them, and the next fault is tried all the same."""
    failures = [["GPIO22 is stuck."], []]
    monkeypatch.setattr(bench, "close", lambda: failures.pop(0))
    found = Trial(bench).results(_fault(bench.events))
    assert list(found) == [("bad", "Not everything is at rest: GPIO22 is stuck.")]
