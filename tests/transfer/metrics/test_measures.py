"""Measures of an arm against scratch, and their summary, equal hand-computed values."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.curves import LearningCurves, Reference, in_total_steps
from shapechanger.transfer.metrics.intervals import Estimate
from shapechanger.transfer.metrics.measures import (
    DEFAULT_THRESHOLDS,
    MIN_HEADROOM,
    ReachTimes,
    Summary,
    asymptotic_gain,
    auc_ratio,
    forward_transfer,
    jumpstart,
    steps_to_reach,
    summarise,
    time_to_threshold,
    total_reward_gain,
)

STEPS = np.array([0.0, 10.0, 20.0, 40.0])
# The mean over seeds of scratch is 0.1, 0.2, 0.4, 0.8, of the arm 0.4, 0.6, 0.8, 1.0.
SCRATCH = LearningCurves(STEPS, np.array([[0.0, 0.1, 0.4, 0.7], [0.2, 0.3, 0.4, 0.9]]))
ARM = LearningCurves(
    STEPS, np.array([[0.3, 0.6, 0.9, 1.0], [0.4, 0.6, 0.8, 1.0], [0.5, 0.6, 0.7, 1.0]])
)
ZERO_SHOT = LearningCurves(np.array([0.0]), np.array([[0.5], [0.6]]))


def ratio(arm: LearningCurves, scratch: LearningCurves) -> Estimate:
    return auc_ratio(arm, scratch, rng=np.random.default_rng(0))


@pytest.mark.parametrize(
    ("source_steps", "scratch_by_then"),
    [(0, 0.1), (5, 0.15), (10, 0.2), (30, 0.6), (40, 0.8), (1000, 0.8)],
)
def test_jumpstart_in_total_steps(source_steps: int, scratch_by_then: float) -> None:
    """The arm is compared with scratch at the source steps, or at the end of scratch."""
    estimate = jumpstart(in_total_steps(ARM, source_steps, 0.0), SCRATCH)
    assert estimate.value == pytest.approx(0.4 - scratch_by_then)


@pytest.mark.parametrize(("last_k", "gain"), [(1, 0.2), (2, 0.3), (4, 0.325)])
def test_asymptotic_gain(last_k: int, gain: float) -> None:
    """Means over the last k evaluations: 1 - 0.8, then 0.9 - 0.6, then 0.7 - 0.375."""
    assert asymptotic_gain(ARM, SCRATCH, last_k=last_k).value == pytest.approx(gain)


@pytest.mark.parametrize(
    ("source_steps", "gain"),
    [
        # At total steps 20 and 40 the arm has its values of target steps 15 and 35: 0.7 and 0.95.
        (5, (0.7 + 0.95) / 2 - 0.6),
        # At 20 steps the arm has the floor, and at 40 its value of target step 10.
        (30, (0.0 + 0.6) / 2 - 0.6),
        # The source training ends at the horizon.
        (40, (0.0 + 0.4) / 2 - 0.6),
        # The source takes the whole budget.
        (41, -0.6),
    ],
)
def test_asymptotic_gain_in_total_steps(source_steps: int, gain: float) -> None:
    """The curves end with the budget, which includes source steps."""
    total = in_total_steps(ARM, source_steps, floor=0.0)
    assert asymptotic_gain(total, SCRATCH, last_k=2).value == pytest.approx(gain)


def test_areas() -> None:
    """Areas are 5 + 7 + 18 and 1.5 + 3 + 12; with enough seeds there is a bootstrap interval."""
    assert total_reward_gain(ARM, SCRATCH).value == pytest.approx((30.0 - 16.5) / 40.0)
    assert ratio(ARM, SCRATCH).value == pytest.approx(30.0 / 16.5)
    twice = [LearningCurves(STEPS, np.tile(c.returns, (2, 1))) for c in (ARM, SCRATCH)]
    estimate = ratio(*twice)
    assert estimate.method == "studentised bootstrap"
    assert estimate.low is not None
    assert estimate.high is not None
    assert estimate.low < 30.0 / 16.5 < estimate.high


@pytest.mark.parametrize("height", [0.0, -0.5])
def test_auc_ratio_needs_an_area_above_zero(height: float) -> None:
    estimate = ratio(ARM, LearningCurves(STEPS, np.full((2, 4), height)))
    assert estimate.value is None
    assert "not above zero" in estimate.note


def test_zero_shot_has_a_start_and_an_end() -> None:
    assert jumpstart(ZERO_SHOT, SCRATCH).value == pytest.approx(0.45)
    end = asymptotic_gain(ZERO_SHOT, SCRATCH, last_k=2)
    assert end.value == pytest.approx(0.55 - 0.6)
    assert end.note == "The arm is not trained on the target: its one evaluation counts as its end."
    assert end.method == "Welch's t"
    # Of one seed, the note gives both reasons.
    one = LearningCurves(np.array([0.0]), np.array([[0.5]]))
    note = asymptotic_gain(one, SCRATCH, last_k=1).note
    assert "not trained" in note
    assert "at least two seeds" in note


def test_every_measure_refuses_other_evaluations() -> None:
    shorter, rng = LearningCurves(STEPS[:3], ARM.returns[:, :3]), np.random.default_rng(0)
    for measure in (
        jumpstart,
        partial(asymptotic_gain, last_k=1),
        total_reward_gain,
        ratio,
        partial(forward_transfer, rng=rng),
        partial(time_to_threshold, threshold=0.5),
    ):
        with pytest.raises(StudyError, match="must be the same"):
            measure(shorter, SCRATCH)


# The seeds reach 0.5 at step 5, at step 30, never, and at step 0, after which the curve falls.
LATE = LearningCurves(
    STEPS, np.array([[0, 1.0, 1.0, 1.0], [0, 0, 0, 1.0], [0, 0.2, 0.4, 0.3], [0.5, 0.0, 0.0, 0.9]])
)
# The seeds reach 0.5 at step 40 and never.
SLOW = LearningCurves(STEPS, np.array([[0, 0, 0, 0.5], [0, 0, 0, 0.4]]))


def test_first_crossing_of_the_line() -> None:
    """Curves are linear between evaluations; the first step at the threshold counts."""
    np.testing.assert_allclose(steps_to_reach(LATE, 0.5), [5.0, 30.0, math.inf, 0.0])
    np.testing.assert_allclose(steps_to_reach(SLOW, 0.5), [40.0, math.inf])
    # A floor above the threshold reaches it at once.
    assert not steps_to_reach(in_total_steps(LATE, 10, 0.6), 0.5).any()
    np.testing.assert_allclose(steps_to_reach(LATE, -1.0), np.zeros(4))


def test_no_seed_is_dropped() -> None:
    """A censored seed counts as the horizon: (5 + 30 + 40 + 0) / 4 against 40."""
    times = time_to_threshold(LATE, SLOW, 0.5)
    assert times.threshold == 0.5
    assert times.arm == ReachTimes(fraction=0.75, restricted_mean=18.75, restricted_median=5.0)
    assert times.scratch == ReachTimes(fraction=0.5, restricted_mean=40.0, restricted_median=40.0)
    assert times.steps_saved.value == pytest.approx(21.25)
    assert times.steps_saved.method == "Welch's t"
    # The median is None if fewer than half the seeds reach the threshold.
    times = time_to_threshold(LATE, SLOW, 0.95)
    assert times.arm is not None
    assert times.arm.restricted_median == pytest.approx(39.0)
    assert times.scratch == ReachTimes(fraction=0.0, restricted_mean=40.0, restricted_median=None)
    # If no seed reaches the threshold, 0 steps are saved, without an interval.
    times = time_to_threshold(LATE, SLOW, 2.0)
    assert times.steps_saved.value == 0.0
    assert times.steps_saved.low is None
    assert "all seeds" in times.steps_saved.note


@pytest.mark.parametrize(
    ("refused", "words"),
    [
        *((partial(time_to_threshold, LATE, SLOW, at), "finite") for at in (math.nan, math.inf)),
        *((partial(asymptotic_gain, ARM, SCRATCH, last_k=k), "1 to 4") for k in (-1, 0, 5)),
    ],
)
def test_impossible_arguments_are_refused(refused: Callable[[], object], words: str) -> None:
    with pytest.raises(StudyError, match=words):
        refused()


THREE = np.array([0.0, 10.0, 20.0])


def curves(*rows: tuple[float, float, float]) -> LearningCurves:
    return LearningCurves(THREE, np.array(rows))


def transfer(arm: LearningCurves, scratch: LearningCurves) -> Estimate:
    return forward_transfer(arm, scratch, rng=np.random.default_rng(0))


# The areas are 0.4 and 0.6 with mean 0.5, and 0.1 and 0.3 with mean 0.2.
BETTER = curves((0.0, 0.4, 0.8), (0.2, 0.6, 1.0))
WORSE = curves((0.0, 0.1, 0.2), (0.1, 0.3, 0.5))


def test_forward_transfer_has_an_interval() -> None:
    """With enough seeds there is a bootstrap interval, whose ends are at most 1."""
    heights = np.linspace(0.0, 0.3, 5)
    arm = curves(*((h, 0.3 + h, 0.6 + h) for h in heights))
    scratch = curves(*((h, h, h) for h in heights))
    estimate = transfer(arm, scratch)
    assert estimate.method == "studentised bootstrap"
    assert estimate.value is not None
    assert estimate.low is not None
    assert estimate.high is not None
    assert 0.0 < estimate.low < estimate.value < estimate.high < 1.0
    # Most seeds are near the maximum, so the interval is clipped at 1.
    skewed = curves(*((h, h, h) for h in (0.99, 0.98, 1.0, 0.95, 0.2)))
    assert transfer(skewed, scratch).high == 1.0


def test_forward_transfer_in_both_counts() -> None:
    """With half of the budget spent on the source, the result is (0.15 - 0.2) / (1 - 0.2)."""
    assert transfer(BETTER, WORSE).value == pytest.approx(0.375)
    assert transfer(in_total_steps(BETTER, 10, 0.0), WORSE).value == pytest.approx(-0.0625)


@pytest.mark.parametrize(
    ("height", "is_defined"), [(1.0, False), (0.995, False), (0.98, True), (0.0, True)]
)
def test_headroom_is_needed(height: float, is_defined: bool) -> None:
    estimate = transfer(BETTER, curves((height, height, height)))
    assert (estimate.value is not None) is is_defined
    if not is_defined:
        assert f"less than {MIN_HEADROOM:g}" in estimate.note


@pytest.mark.parametrize("outside", [-0.1, 1.1])
def test_scores_must_be_clipped(outside: float) -> None:
    wild = curves((0.0, 0.5, outside))
    for arm, scratch in (
        (wild, WORSE),
        (BETTER, wild),
        (in_total_steps(BETTER, 5, outside), WORSE),
    ):
        with pytest.raises(StudyError, match="clip=True"):
            transfer(arm, scratch)


REFERENCE = Reference(zero=-100.0, one=300.0)
# The mean scores are 0, 0.5, 1 and 0.5, 1, 1.5.
RETURNS = LearningCurves(THREE, np.array([[-120.0, 90.0, 290.0], [-80.0, 110.0, 310.0]]))
ARM_RETURNS = LearningCurves(THREE, np.array([[90.0, 280.0, 510.0], [110.0, 320.0, 490.0]]))
UNTRAINED = LearningCurves(np.array([0.0]), np.array([[90.0], [110.0]]))


def summary(
    arm: LearningCurves = ARM_RETURNS, reference: Reference = REFERENCE, source_steps: float = 10
) -> Summary:
    return summarise(
        RETURNS, arm, reference, source_steps=source_steps, rng=np.random.default_rng(0), last_k=1
    )


def test_both_counts_by_hand() -> None:
    """The gains are 0.5, and the areas 1 and 0.5."""
    measured = summary().in_target_steps
    assert measured.jumpstart.value == pytest.approx(0.5)
    assert measured.asymptotic_gain.value == pytest.approx(0.5)
    assert measured.total_reward_gain.value == pytest.approx(0.5)
    assert measured.auc_ratio.value == pytest.approx(2.0)
    # Clipped, the areas of the arm's seeds are 0.84375 and 0.88125, scratch's 0.48125 and 0.525.
    transferred = (0.8625 - 0.503125) / (1.0 - 0.503125)
    assert measured.forward_transfer.value == pytest.approx(transferred)
    # Ten of twenty steps go to the source: scratch is at 0.5 by then, the arm ends at 1.
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


def test_without_scores_only_gains_are_defined() -> None:
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
    assert [time.threshold for time in measured.times_to_threshold] == [0.25, 0.5, 0.75, 0.9]
    assert all(time.arm is time.scratch is None for time in measured.times_to_threshold)
    # In total steps, the floor is the return without skill: (400 · 10 + 200 · 10) / 20 - 100.
    assert result.in_total_steps.total_reward_gain.value == pytest.approx(200.0)


def test_both_ways_of_counting_use_the_same_resamples() -> None:
    """Each measure's resamples start from one draw of the generator."""
    result = summary(source_steps=0)
    assert result.in_target_steps == result.in_total_steps
    draw = int(np.random.default_rng(0).integers(2**63))
    curves = REFERENCE.scores(ARM_RETURNS, clip=True), REFERENCE.scores(RETURNS, clip=True)
    rng = np.random.default_rng(draw)
    transfer = forward_transfer(*curves, rng=rng)
    assert result.in_target_steps.forward_transfer == transfer
    returns = 100.0 + 50.0 * np.random.default_rng(1).normal(size=(2, 5, 3))
    arm, scratch = (LearningCurves(THREE, one) for one in returns)
    ratio = auc_ratio(
        REFERENCE.scores(arm), REFERENCE.scores(scratch), rng=np.random.default_rng(draw)
    )
    of_five = summarise(
        *(scratch, arm, REFERENCE), source_steps=0, rng=np.random.default_rng(0), last_k=1
    )
    assert of_five.in_target_steps.auc_ratio == ratio
    assert ratio.low is not None


def test_zero_shot_is_summarised_without_error() -> None:
    """One evaluation has a jumpstart and an end; the rest is undefined, with notes."""
    result = summary(UNTRAINED)
    for measured in (result.in_target_steps, result.in_total_steps):
        assert measured.asymptotic_gain.value == pytest.approx(-0.5)
        for missing in (measured.total_reward_gain, measured.auc_ratio, measured.forward_transfer):
            assert missing.value is None
            assert "only one evaluation" in missing.note
        assert all(times.arm is None for times in measured.times_to_threshold)
    assert result.in_target_steps.jumpstart.value == pytest.approx(0.5)
    assert result.in_total_steps.jumpstart.value == pytest.approx(0.0)
