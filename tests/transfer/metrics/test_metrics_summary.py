"""The summary: both ways of counting steps, both units, and JSON."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from shapechanger.transfer.metrics.curves import LearningCurves, Reference
from shapechanger.transfer.metrics.intervals import Estimate
from shapechanger.transfer.metrics.measures import (
    DEFAULT_THRESHOLDS,
    Measures,
    Summary,
    forward_transfer,
    summarise,
)

STEPS = np.array([0.0, 10.0, 20.0])
REFERENCE = Reference(zero=-100.0, one=300.0)
# In scores: 0, 0.5, 1 on the mean; and 0.5, 1, 1.5.
SCRATCH = LearningCurves(STEPS, np.array([[-120.0, 90.0, 290.0], [-80.0, 110.0, 310.0]]))
ARM = LearningCurves(STEPS, np.array([[90.0, 280.0, 510.0], [110.0, 320.0, 490.0]]))
ZERO_SHOT = LearningCurves(np.array([0.0]), np.array([[90.0], [110.0]]))


def summary(
    arm: LearningCurves = ARM, reference: Reference = REFERENCE, source_steps: float = 10
) -> Summary:
    """Return a summary with few resamples."""
    return summarise(
        SCRATCH, arm, reference, source_steps=source_steps, rng=np.random.default_rng(0), last_k=1
    )


def estimates(measures: Measures) -> dict[str, Estimate]:
    """Return the five estimates that are not times."""
    return {
        "jumpstart": measures.jumpstart,
        "asymptotic_gain": measures.asymptotic_gain,
        "total_reward_gain": measures.total_reward_gain,
        "auc_ratio": measures.auc_ratio,
        "forward_transfer": measures.forward_transfer,
    }


def test_target_steps_by_hand() -> None:
    """Gains of 0.5, and areas of 1 and 0.5."""
    measured = summary().in_target_steps
    values = {name: estimate.value for name, estimate in estimates(measured).items()}
    assert values == pytest.approx(
        {
            "jumpstart": 0.5,
            "asymptotic_gain": 0.5,
            "total_reward_gain": 0.5,
            "auc_ratio": 2.0,
            # Clipped, the areas of the arm's seeds are 0.84375 and 0.88125, scratch's 0.48125 and
            # 0.525.
            "forward_transfer": (0.8625 - 0.503125) / (1.0 - 0.503125),
        }
    )


def test_total_steps_by_hand() -> None:
    """Ten of twenty steps go to the source: scratch is at 0.5 by then, the arm ends at 1."""
    measured = summary().in_total_steps
    assert measured.jumpstart.value == pytest.approx(0.0)
    assert measured.asymptotic_gain.value == pytest.approx(0.0)
    assert measured.total_reward_gain.value == pytest.approx(0.375 - 0.5)
    assert measured.auc_ratio.value == pytest.approx(0.75)


def test_summary_states_its_settings() -> None:
    result = summary()
    assert (result.unit, result.reference) == ("score", REFERENCE)
    assert (result.horizon, result.source_steps) == (20.0, 10.0)
    assert (result.n_seeds_arm, result.n_seeds_scratch) == (2, 2)
    assert (result.last_k, result.confidence) == (1, 0.95)
    for measured in (result.in_target_steps, result.in_total_steps):
        assert tuple(t.threshold for t in measured.times_to_threshold) == DEFAULT_THRESHOLDS
    assert result == summary()


def test_arms_that_did_not_learn_leave_values() -> None:
    """Without scores, gains are in units of the measure and the rest is undefined."""
    result = summary(reference=Reference(zero=400.0, one=300.0))
    assert result.unit == "value"
    measured = result.in_target_steps
    assert measured.jumpstart.value == pytest.approx(200.0)
    assert measured.asymptotic_gain.value == pytest.approx(200.0)
    assert measured.total_reward_gain.value == pytest.approx(200.0)
    for missing in (
        measured.auc_ratio,
        measured.forward_transfer,
        *(times.steps_saved for times in measured.times_to_threshold),
    ):
        assert missing.value is None
        assert "no score" in missing.note
    assert len(measured.times_to_threshold) == len(DEFAULT_THRESHOLDS)
    # In total steps, the floor is the return without skill: (400 · 10 + 200 · 10) / 20 - 100.
    assert result.in_total_steps.total_reward_gain.value == pytest.approx(200.0)


def test_both_ways_of_counting_use_the_same_resamples() -> None:
    """Those of each measure begin with one draw of the generator."""
    result = summary(source_steps=0)
    assert result.in_target_steps == result.in_total_steps
    draw = int(np.random.default_rng(0).integers(2**63))
    curves = REFERENCE.scores(ARM, clip=True), REFERENCE.scores(SCRATCH, clip=True)
    rng = np.random.default_rng(draw)
    transfer = forward_transfer(*curves, rng=rng)
    assert result.in_target_steps.forward_transfer == transfer
    undefined = summary(reference=Reference(zero=400.0, one=300.0)).in_target_steps
    assert [time.threshold for time in undefined.times_to_threshold] == [0.25, 0.5, 0.75, 0.9]
    assert all(time.arm is time.scratch is None for time in undefined.times_to_threshold)


def test_zero_shot_is_summarised_without_error() -> None:
    """One evaluation has a jumpstart and an end; the rest is undefined, with notes."""
    result = summary(ZERO_SHOT)
    for measured in (result.in_target_steps, result.in_total_steps):
        assert measured.asymptotic_gain.value == pytest.approx(-0.5)
        for missing in (measured.total_reward_gain, measured.auc_ratio, measured.forward_transfer):
            assert missing.value is None
            assert "one evaluation only" in missing.note
        assert all(times.arm is None for times in measured.times_to_threshold)
    assert result.in_target_steps.jumpstart.value == pytest.approx(0.5)
    assert result.in_total_steps.jumpstart.value == pytest.approx(0.0)


@pytest.mark.parametrize(
    "result",
    [summary(), summary(ZERO_SHOT), summary(reference=Reference(400.0, 300.0))],
    ids=["arm", "zero-shot", "no scores"],
)
def test_summaries_survive_json(result: Summary) -> None:
    """Summaries round trip through JSON, undefined measures included."""
    assert msgspec.json.decode(msgspec.json.encode(result), type=Summary) == result
