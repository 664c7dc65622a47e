"""Time to threshold: how soon a run is good enough, for runs that may never be."""

from __future__ import annotations

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.curves import LearningCurves, check_comparable
from shapechanger.transfer.metrics.intervals import Estimate, estimate_difference, undefined
from shapechanger.transfer.metrics.taylor_stone import NO_CURVE

__all__ = ["ReachTimes", "TimeToThreshold", "steps_to_reach", "time_to_threshold"]


class ReachTimes(msgspec.Struct, frozen=True):
    """When the seeds of one arm reached a threshold.

    All seeds count. One that did not reach it is right-censored at the horizon H, the same for all
    seeds, so that the Kaplan-Meier estimate is the plain empirical one.

    Attributes:
        fraction: Share of the seeds that reached it by H, from 0 to 1.
        restricted_mean: Mean of min(time, H) in steps, from 0 to H: the restricted mean survival
            time (Royston & Parmar, BMC Med. Res. Methodol. 13:152, 2013).
        restricted_median: Step by which half the seeds had reached it; None if fewer did by H.
    """

    fraction: float
    restricted_mean: float
    restricted_median: float | None


class TimeToThreshold(msgspec.Struct, frozen=True):
    """How much sooner an arm reaches a threshold than scratch.

    Attributes:
        threshold: The declared height, in units of the curves.
        arm: Times of the arm; None where they are undefined.
        scratch: Times of scratch; None where they are undefined.
        steps_saved: Restricted mean of scratch minus that of the arm, in steps; positive if the
            arm is sooner.
    """

    threshold: float
    arm: ReachTimes | None
    scratch: ReachTimes | None
    steps_saved: Estimate


def steps_to_reach(curves: LearningCurves, threshold: float) -> NDArray[np.float64]:
    """First step at which each seed is at or above `threshold`, shape (n_seeds,).

    The first step at which the straight line between two evaluations is there; infinity if it is
    not until the horizon. The grid of evaluations would do as well in target steps, but source
    steps need not fall on it, and it would round the times of all seeds to a few values.

    Args:
        curves: Curves in target steps or in total steps.
        threshold: In units of the curves.
    """
    if curves.source_steps > 0.0 and curves.floor >= threshold:
        return np.zeros(curves.n_seeds)
    times = [_first_step(curves.steps, row, threshold) for row in curves.returns]
    steps = np.array(times) + curves.source_steps
    return np.where(steps <= curves.horizon, steps, np.inf)


def time_to_threshold(
    arm: LearningCurves, scratch: LearningCurves, threshold: float, *, confidence: float = 0.95
) -> TimeToThreshold:
    """Taylor & Stone's time to threshold (JMLR 10, 2009, section 2), without dropping seeds.

    The times are compared by their restricted means, because a mean over the seeds that reached the
    threshold would favour the arm with the fewest of them.

    Args:
        arm: Curves of the arm.
        scratch: Curves of the baseline, evaluated at the same steps.
        threshold: Declared before the study, in units of the curves.
        confidence: Of Welch's interval.

    Raises:
        StudyError: If the curves cannot be compared or the threshold is not finite.
    """
    check_comparable(arm, scratch)
    if not math.isfinite(threshold):
        raise StudyError(f"A threshold must be finite, got {threshold}.")
    if arm.n_evals == 1:
        return TimeToThreshold(threshold, None, None, undefined(NO_CURVE))
    arm_steps = steps_to_reach(arm, threshold)
    scratch_steps = steps_to_reach(scratch, threshold)
    saved = estimate_difference(
        # Swapped, because later means more steps and sooner is the gain.
        np.minimum(scratch_steps, scratch.horizon),
        np.minimum(arm_steps, arm.horizon),
        confidence=confidence,
    )
    return TimeToThreshold(
        threshold,
        _reach_times(arm_steps, arm.horizon),
        _reach_times(scratch_steps, scratch.horizon),
        saved,
    )


def _first_step(steps: NDArray[np.float64], row: NDArray[np.float64], threshold: float) -> float:
    """First crossing of one curve in its own steps, infinity if there is none."""
    above = np.flatnonzero(row >= threshold)
    if above.size == 0:
        return math.inf
    after = int(above[0])
    if after == 0:
        return 0.0
    # The curve rises from below the threshold, so it may be read the other way round.
    around = slice(after - 1, after + 1)
    return float(np.interp(threshold, row[around], steps[around]))


def _reach_times(steps: NDArray[np.float64], horizon: float) -> ReachTimes:
    """Summarise first steps, shape (n_seeds,), infinite where censored."""
    half = float(np.sort(steps)[(steps.size - 1) // 2])
    return ReachTimes(
        fraction=float(np.isfinite(steps).mean()),
        restricted_mean=float(np.minimum(steps, horizon).mean()),
        restricted_median=half if math.isfinite(half) else None,
    )
