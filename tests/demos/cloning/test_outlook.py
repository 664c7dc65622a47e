"""Collisions to expect of a clone of so much driving."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.evaluation import CORRECTED, EXPERT, Driven, outlook
from shapechanger.demos.cloning.pictures import Framing
from shapechanger.layout import Feature, Layout
from tests.demos.cloning.data import KEYS, STATE, STEERS

RESULTS = Path(__file__).parents[3] / "benchmarks" / "results" / "corrections.json"


def _card(learned_s: object, layout: Layout | None = STEERS, **changes: Any) -> CloneCard:
    return CloneCard(
        framing=Framing(),
        channels=(4,),
        features=4,
        action_layout=layout,
        data={"learned_s": learned_s},
        **changes,
    )


@pytest.mark.parametrize("row", [*EXPERT, *CORRECTED])
def test_rates_are_those_of_the_benchmark(row: Driven) -> None:
    rows = json.loads(RESULTS.read_text())["rows"]
    (found,) = [each for each in rows if each["name"].startswith(f"{row.row}: collisions")]
    assert float(found["value"]) == row.per_100_m
    _, _, by_seed = found["spread"].partition("by seed ")
    assert tuple(float(each) for each in by_seed.split(", ") if each) == row.by_seed


@given(st.floats(1.0, 1e5), st.sampled_from([STEERS, KEYS]))
def test_every_driver_hears_a_rate_and_a_next_step(learned_s: float, layout: Layout) -> None:
    found = outlook(_card(learned_s, layout))
    assert found is not None
    assert f"{found.minutes:.1f} minutes" in found.expected
    assert any(f"{row.per_100_m:.1f}" in found.expected for row in EXPERT)
    assert "--corrected-by expert" in found.next_step
    assert ("record more" in found.next_step) == (found.minutes < EXPERT[-1].minutes)


@given(st.floats(1.0, 1e5), st.floats(1.0, 10.0))
def test_more_driving_never_promises_more_collisions(learned_s: float, more: float) -> None:
    """The worse end of the stated range falls with the length."""

    def worst(seconds: float) -> float:
        found = outlook(_card(seconds))
        assert found is not None
        words = found.expected.partition("expect ")[2].partition(" collisions")[0]
        rates = [float(x) for x in re.findall(r"\d+\.\d", words)]
        return max(rates) + 10.0 * words.startswith("more than")

    assert worst(learned_s * more) <= worst(learned_s)


def test_two_minutes_of_keys_are_told_to_record_more() -> None:
    found = outlook(_card(96.0, KEYS))
    assert found is not None
    assert "more than 3.5 (5.9 for the worst of 3 seeds) collisions per 100 m" in found.expected
    assert "record more (1.1 per 100 m after 4 minutes)" in found.next_step


@pytest.mark.parametrize("learned_s", [0.0, float("nan"), float("inf"), "long", None])
def test_an_unknown_length_promises_nothing(learned_s: object) -> None:
    assert outlook(_card(learned_s)) is None


def test_other_robots_are_promised_nothing() -> None:
    assert outlook(_card(60.0, None)) is None
    assert outlook(_card(60.0, Layout((Feature("tension/FDP", "N"),)))) is None
    assert outlook(_card(60.0, eyes="none", nerves=(4,), state_layout=STATE)) is None
