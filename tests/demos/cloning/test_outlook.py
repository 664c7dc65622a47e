"""Collisions to expect of a clone of so much driving."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from shapechanger.demos.clone_report import CORRECTED, EXPERT, outlook
from shapechanger.layout import Feature, Layout
from tests.demos.cloning.data import KEYS, STATE, STEERS, clone_card

RESULTS = Path(__file__).parents[3] / "benchmarks" / "results" / "corrections.json"
ROWS = {
    "car, 3 seeds, cloned from 2 minutes of the expert": EXPERT[2],
    "car, 3 seeds, after 2 more of the expert instead": EXPERT[4],
    "car, cloned from 10 minutes of the expert": EXPERT[10],
    "car, 3 seeds, after a round of 2 minutes of corrections": CORRECTED[4],
    "car, after a round of 10 minutes of corrections": CORRECTED[20],
}


def _outlook(learned_s: object, layout: Layout | None = STEERS, **card: Any) -> str:
    return outlook(clone_card(layout, data={"learned_s": learned_s}, **card))


@pytest.mark.parametrize("name", ROWS)
def test_rates_are_those_of_the_benchmark(name: str) -> None:
    rows = json.loads(RESULTS.read_text())["rows"]
    (found,) = [each for each in rows if each["name"].startswith(f"{name}: collisions")]
    assert float(found["value"]) == ROWS[name]


@pytest.mark.parametrize("layout", [STEERS, KEYS])
def test_every_driver_hears_a_rate_and_a_next_step(layout: Layout) -> None:
    text = _outlook(90.0, layout)
    assert "1.5 minutes of driving" in text
    assert "3.5 after 2, 1.1 after 4, 0.8 after 10" in text
    assert "--corrected-by expert" in text


@pytest.mark.parametrize("learned_s", [0.0, float("nan"), float("inf"), "long", None])
def test_an_unknown_length_promises_nothing(learned_s: object) -> None:
    assert _outlook(learned_s) == ""


def test_other_robots_are_promised_nothing() -> None:
    assert _outlook(60.0, None) == ""
    assert _outlook(60.0, Layout((Feature("tension/FDP", "N"),))) == ""
    assert _outlook(60.0, eyes="none", nerves=(4,), observation=STATE) == ""
