"""Jumpstart, asymptotic gain, total reward gain and ratio, by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import (
    Estimate,
    LearningCurves,
    asymptotic_gain,
    auc_ratio,
    forward_transfer,
    in_total_steps,
    jumpstart,
    time_to_threshold,
    total_reward_gain,
)

STEPS = np.array([0.0, 10.0, 20.0, 40.0])
# Mean scratch 0.1, 0.2, 0.4, 0.8 and mean arm 0.4, 0.6, 0.8, 1.0.
SCRATCH = LearningCurves(STEPS, np.array([[0.0, 0.1, 0.4, 0.7], [0.2, 0.3, 0.4, 0.9]]))
ARM = LearningCurves(
    STEPS, np.array([[0.3, 0.6, 0.9, 1.0], [0.4, 0.6, 0.8, 1.0], [0.5, 0.6, 0.7, 1.0]])
)
ZERO_SHOT = LearningCurves(np.array([0.0]), np.array([[0.5], [0.6]]))


def ratio(arm: LearningCurves, scratch: LearningCurves) -> Estimate:
    """Return `auc_ratio` with few resamples."""
    return auc_ratio(arm, scratch, rng=np.random.default_rng(0))


def test_jumpstart() -> None:
    """0.4 - 0.1 at the first evaluation, and Welch's interval around it."""
    estimate = jumpstart(ARM, SCRATCH)
    assert estimate.value == pytest.approx(0.3)
    assert estimate.method == "Welch's t"
    assert estimate.low is not None
    assert estimate.low < 0.3


@pytest.mark.parametrize(
    ("source_steps", "scratch_by_then"),
    [(0, 0.1), (5, 0.15), (10, 0.2), (30, 0.6), (40, 0.8), (1000, 0.8)],
)
def test_jumpstart_in_total_steps(source_steps: int, scratch_by_then: float) -> None:
    """Scratch is read at the source steps, or at its end if that is earlier."""
    estimate = jumpstart(in_total_steps(ARM, source_steps, 0.0), SCRATCH)
    assert estimate.value == pytest.approx(0.4 - scratch_by_then)


@pytest.mark.parametrize(("last_k", "gain"), [(1, 0.2), (2, 0.3), (4, 0.325)])
def test_asymptotic_gain(last_k: int, gain: float) -> None:
    """Means over the last k evaluations: 1 - 0.8, then 0.9 - 0.6, then 0.7 - 0.375."""
    assert asymptotic_gain(ARM, SCRATCH, last_k=last_k).value == pytest.approx(gain)


@pytest.mark.parametrize("last_k", [-1, 0, 5])
def test_the_last_evaluations_must_exist(last_k: int) -> None:
    with pytest.raises(StudyError, match="from 1 to 4"):
        asymptotic_gain(ARM, SCRATCH, last_k=last_k)


@pytest.mark.parametrize(
    ("source_steps", "gain"),
    [
        # The arm at 20 and 40 equals its values at 15 and 35: 0.7 and 0.95.
        (5, (0.7 + 0.95) / 2 - 0.6),
        # The floor at 20, and at 40 what it was at 10.
        (30, (0.0 + 0.6) / 2 - 0.6),
        # At the horizon the source is just finished.
        (40, (0.0 + 0.4) / 2 - 0.6),
        # The source takes the whole budget.
        (41, -0.6),
    ],
)
def test_asymptotic_gain_in_total_steps(source_steps: int, gain: float) -> None:
    """The end is the budget's, which includes source steps."""
    total = in_total_steps(ARM, source_steps, floor=0.0)
    assert asymptotic_gain(total, SCRATCH, last_k=2).value == pytest.approx(gain)


def test_total_reward_gain() -> None:
    """Areas 5 + 7 + 18 = 30 and 1.5 + 3 + 12 = 16.5, over 40 steps."""
    assert total_reward_gain(ARM, SCRATCH).value == pytest.approx((30.0 - 16.5) / 40.0)


def test_auc_ratio() -> None:
    """30 over 16.5, with a bootstrap interval once there are enough seeds."""
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
    assert (
        end.note == "The arm is not trained on the target: its one evaluation stands for its end."
    )
    assert end.method == "Welch's t"


def test_zero_shot_of_one_seed_keeps_both_reasons() -> None:
    """The note states both that it is not trained and that there is no interval."""
    one = LearningCurves(np.array([0.0]), np.array([[0.5]]))
    note = asymptotic_gain(one, SCRATCH, last_k=1).note
    assert "not trained" in note
    assert "at least two seeds" in note


@pytest.mark.parametrize(
    "measure",
    [
        jumpstart,
        lambda a, b: asymptotic_gain(a, b, last_k=1),
        total_reward_gain,
        ratio,
        lambda a, b: forward_transfer(a, b, rng=np.random.default_rng(0)),
        lambda a, b: time_to_threshold(a, b, 0.5),
    ],
    ids=["jumpstart", "asymptotic", "total reward", "ratio", "forward transfer", "threshold"],
)
def test_every_measure_refuses_other_evaluations(
    measure: Callable[[LearningCurves, LearningCurves], object],
) -> None:
    shorter = LearningCurves(STEPS[:3], ARM.returns[:, :3])
    with pytest.raises(StudyError, match="must be the same"):
        measure(shorter, SCRATCH)
