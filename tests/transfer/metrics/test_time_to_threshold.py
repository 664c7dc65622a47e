"""Time to threshold: crossings, censoring and medians, by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import (
    LearningCurves,
    ReachTimes,
    in_total_steps,
    steps_to_reach,
    time_to_threshold,
)

STEPS = np.array([0.0, 10.0, 20.0, 40.0])
# Reach 0.5 at 5, at 30, never, and at 0 although it falls below again.
ARM = LearningCurves(
    STEPS,
    np.array([[0, 1.0, 1.0, 1.0], [0, 0, 0, 1.0], [0, 0.2, 0.4, 0.3], [0.5, 0.0, 0.0, 0.9]]),
)
# Reaches 0.5 at 40 and never.
SCRATCH = LearningCurves(STEPS, np.array([[0, 0, 0, 0.5], [0, 0, 0, 0.4]]))


def test_first_crossing_of_the_line() -> None:
    """Linear between evaluations; reaching the threshold is enough; later falls do not count."""
    np.testing.assert_allclose(steps_to_reach(ARM, 0.5), [5.0, 30.0, math.inf, 0.0])
    np.testing.assert_allclose(steps_to_reach(SCRATCH, 0.5), [40.0, math.inf])


def test_a_floor_above_the_threshold_is_there_at_once() -> None:
    assert not steps_to_reach(in_total_steps(ARM, 10, 0.6), 0.5).any()
    np.testing.assert_allclose(steps_to_reach(ARM, -1.0), np.zeros(4))


def test_no_seed_is_dropped() -> None:
    """A censored seed counts as the horizon: (5 + 30 + 40 + 0) / 4 against 40."""
    times = time_to_threshold(ARM, SCRATCH, 0.5)
    assert times.threshold == 0.5
    assert times.arm == ReachTimes(fraction=0.75, restricted_mean=18.75, restricted_median=5.0)
    assert times.scratch == ReachTimes(fraction=0.5, restricted_mean=40.0, restricted_median=40.0)
    assert times.steps_saved.value == pytest.approx(21.25)
    assert times.steps_saved.method == "Welch's t"


def test_median_is_none_if_most_seeds_are_censored() -> None:
    """The median is None if fewer than half the seeds reach the threshold."""
    times = time_to_threshold(ARM, SCRATCH, 0.95)
    assert times.arm is not None
    assert times.arm.restricted_median == pytest.approx(39.0)
    assert times.scratch == ReachTimes(fraction=0.0, restricted_mean=40.0, restricted_median=None)


def test_no_seed_reaches_the_threshold() -> None:
    """Then 0 steps are saved, without an interval."""
    times = time_to_threshold(ARM, SCRATCH, 2.0)
    assert times.steps_saved.value == 0.0
    assert times.steps_saved.low is None
    assert "all seeds" in times.steps_saved.note


@pytest.mark.parametrize("threshold", [math.nan, math.inf])
def test_threshold_is_a_number(threshold: float) -> None:
    with pytest.raises(StudyError, match="finite"):
        time_to_threshold(ARM, SCRATCH, threshold)
