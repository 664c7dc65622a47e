"""Collisions to expect of a clone of so much driving."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.demos.clone_report import CORRECTED, EXPERT, outlook
from shapechanger.layout import Feature, Layout
from tests.demos.cloning.data import KEYS, STATE, STEERS, clone_card

RESULTS = Path(__file__).parents[3] / "benchmarks" / "results" / "corrections.json"
ROWS = {
    "car, 3 seeds, cloned from 2 minutes of the expert": EXPERT[2],
    "car, 3 seeds, after 2 more of the expert instead": EXPERT[4],
    "car, cloned from 10 minutes of the expert": EXPERT[10],
    "car, 3 seeds, after a round of 2 minutes of corrections": (CORRECTED[4], 1.10),
    "car, after a round of 10 minutes of corrections": (CORRECTED[20], None),
}


def _outlook(learned_s: object, layout: Layout | None = STEERS, **card: Any) -> str:
    return outlook(clone_card(layout, data={"learned_s": learned_s}, **card))


@pytest.mark.parametrize("name", ROWS)
def test_rates_are_those_of_the_benchmark(name: str) -> None:
    rows = json.loads(RESULTS.read_text())["rows"]
    (found,) = [each for each in rows if each["name"].startswith(f"{name}: collisions")]
    _, _, by_seed = found["spread"].partition("by seed ")
    worst = max((float(each) for each in by_seed.split(", ") if each), default=None)
    assert (float(found["value"]), worst) == ROWS[name]


@given(st.floats(1.0, 1e5), st.sampled_from([STEERS, KEYS]))
def test_every_driver_hears_a_rate_and_a_next_step(learned_s: float, layout: Layout) -> None:
    minutes, text = round(learned_s / 60, 1), _outlook(learned_s, layout)
    assert f"{minutes:.1f} minutes" in text
    assert any(f"{rate:.1f}" in text.partition(" per 100 m")[0] for rate, _ in EXPERT.values())
    assert "--corrected-by expert" in text
    assert ("record more" in text) == (minutes < max(EXPERT))


@given(st.floats(1.0, 1e5), st.floats(1.0, 10.0))
def test_more_driving_never_promises_more_collisions(learned_s: float, more: float) -> None:
    """The worse end of the stated range falls with the length."""

    def worst(seconds: float) -> float:
        words = _outlook(seconds).partition("expect ")[2].partition(" collisions")[0]
        rates = [float(x) for x in re.findall(r"\d+\.\d", words)]
        return max(rates) + 10.0 * words.startswith("more than")

    assert worst(learned_s * more) <= worst(learned_s)


@pytest.mark.parametrize("learned_s", [0.0, float("nan"), float("inf"), "long", None])
def test_an_unknown_length_promises_nothing(learned_s: object) -> None:
    assert _outlook(learned_s) == ""


def test_other_robots_are_promised_nothing() -> None:
    assert _outlook(60.0, None) == ""
    assert _outlook(60.0, Layout((Feature("tension/FDP", "N"),))) == ""
    assert _outlook(60.0, eyes="none", nerves=(4,), observation=STATE) == ""
