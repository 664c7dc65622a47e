"""Expected collisions of a clone, by the duration of its demonstrations."""

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


def test_rates_are_those_of_the_benchmark() -> None:
    rows = json.loads(RESULTS.read_text())["rows"]
    for name, rate in ROWS.items():
        (found,) = [each for each in rows if each["name"].startswith(f"{name}: collisions")]
        assert float(found["value"]) == rate


@pytest.mark.parametrize("layout", [STEERS, KEYS])
def test_the_outlook_states_rates_and_the_next_step(layout: Layout) -> None:
    text = _outlook(90.0, layout)
    assert "1.5 minutes of driving" in text
    assert "3.5 after 2, 1.1 after 4, 0.8 after 10" in text
    assert "--corrected-by expert" in text


def test_there_is_no_outlook_for_other_robots_or_unknown_durations() -> None:
    for learned_s in (0.0, float("nan"), float("inf"), "long", None):
        assert _outlook(learned_s) == ""
    assert _outlook(60.0, None) == ""
    assert _outlook(60.0, Layout((Feature("tension/FDP", "N"),))) == ""
    assert _outlook(60.0, eyes="none", nerves=(4,), observation=STATE) == ""
