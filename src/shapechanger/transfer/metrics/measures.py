"""Measures of one arm against scratch: the five of Taylor & Stone, and forward transfer.

Source of the five: M. E. Taylor and P. Stone, "Transfer Learning for Reinforcement Learning
Domains: A Survey", JMLR 10 (2009) 1633-1685, section 2.

p is the mean curve over seeds and H the horizon. Curves of the arm are in target steps or, after
`in_total_steps`, in total steps. Every function of an arm and scratch raises a StudyError if they
cannot be compared. Positive differences mean that transfer helped.
"""

from __future__ import annotations

import math
from typing import Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.curves import (
    LearningCurves,
    Reference,
    check_comparable,
    in_total_steps,
)
from shapechanger.transfer.metrics.intervals import (
    CONFIDENCE,
    Estimate,
    estimate_difference,
    estimate_ratio,
    undefined,
)

_NO_CURVE: Final = "Undefined: it needs a learning curve, and there is only one evaluation."
_NOT_TRAINED: Final = "The arm is not trained on the target: its one evaluation counts as its end."
# An area of scores below this is zero up to rounding.
_ZERO_AREA: Final = 1e-9


def jumpstart(arm: LearningCurves, scratch: LearningCurves) -> Estimate:
    """Initial advantage of the arm on the target, in units of the curves.

    p_arm(0) - p_scratch(0) in target steps; in total steps p_arm(0) - p_scratch(source_steps),
    where scratch has trained as long as the arm on its source. If that is after the horizon,
    scratch's last evaluation is used.

    Args:
        arm: Curves of the arm; one evaluation is enough.
        scratch: Curves of the baseline, evaluated at the same steps.
    """
    check_comparable(arm, scratch)
    return estimate_difference(arm.returns[:, 0], scratch.at(arm.source_steps)[:, 0])


def asymptotic_gain(arm: LearningCurves, scratch: LearningCurves, *, last_k: int) -> Estimate:
    """Final advantage of the arm, in units of the curves.

    Mean of p_arm over the last k evaluations minus the mean of p_scratch at the same steps. In
    total steps, these include the arm's source steps. If an arm is not trained on the target, its
    one evaluation counts as its end, because the policy does not change.

    Args:
        arm: Curves of the arm.
        scratch: Curves of the baseline, evaluated at the same steps.
        last_k: k, number of final evaluations, >= 1. Taylor & Stone use one; more reduce noise.

    Raises:
        StudyError: If the curves cannot be compared or have fewer than k evaluations.
    """
    check_comparable(arm, scratch)
    if not 1 <= last_k <= scratch.n_evals:
        raise StudyError(f"last_k must be from 1 to {scratch.n_evals} evaluations, got {last_k}.")
    steps = scratch.steps[-last_k:]
    gain = estimate_difference(arm.at(steps).mean(axis=1), scratch.at(steps).mean(axis=1))
    if arm.n_evals > 1:
        return gain
    return msgspec.structs.replace(gain, note=f"{_NOT_TRAINED} {gain.note}".rstrip())


def total_reward_gain(arm: LearningCurves, scratch: LearningCurves) -> Estimate:
    """Advantage of the arm averaged over the budget, in units of the curves.

    (∫ p_arm - ∫ p_scratch) / H by the trapezoid rule. Taylor & Stone's total reward is the area;
    divided by the horizon it is the mean height of the curve, which has the unit of the curve and
    does not grow with the budget.

    Args:
        arm: Curves of the arm.
        scratch: Curves of the baseline, evaluated at the same steps.
    """
    check_comparable(arm, scratch)
    if arm.n_evals == 1:
        return undefined(_NO_CURVE)
    return estimate_difference(arm.auc(), scratch.auc())


def auc_ratio(
    arm: LearningCurves, scratch: LearningCurves, *, rng: np.random.Generator
) -> Estimate:
    """Ratio of the areas under the curves of arm and scratch, a pure number; 1 if they are equal.

    ∫ p_arm / ∫ p_scratch, the transfer ratio of Taylor & Stone's list. It depends on constants
    added to the reward, so it is meaningful for scores only, where 0 means no skill.
    Undefined unless scratch's area is above zero.

    Args:
        arm: Scores of the arm.
        scratch: Scores of the baseline, evaluated at the same steps.
        rng: Draws the resamples.
    """
    check_comparable(arm, scratch)
    if arm.n_evals == 1:
        return undefined(_NO_CURVE)
    return estimate_ratio(
        arm.auc(),
        scratch.auc(),
        least=_ZERO_AREA,
        too_small="Undefined: the area under scratch's curve is not above zero.",
        rng=rng,
    )


# Smallest headroom 1 - AUC_b, by which the measure divides. With less, a difference of 0.01 in the
# areas, which is less than the variation between runs, would be a transfer of 1.
MIN_HEADROOM: Final = 0.01


def forward_transfer(
    arm: LearningCurves, scratch: LearningCurves, *, rng: np.random.Generator
) -> Estimate:
    """Forward transfer of Continual World, a pure number of at most 1; 0 means no effect.

    (AUC - AUC_b) / (1 - AUC_b), with AUC of the arm and AUC_b of scratch, both areas divided by the
    horizon (Wołczyk et al., "Continual World", NeurIPS 2021). 1 is the maximum only if no score
    exceeds 1: Continual World uses success rates, and here scores are clipped. Undefined if the
    headroom 1 - AUC_b is below `MIN_HEADROOM`.

    Args:
        arm: Scores of the arm from `Reference.scores(..., clip=True)`.
        scratch: Scores of the baseline, clipped too and evaluated at the same steps.
        rng: Draws the resamples.

    Raises:
        StudyError: If the curves cannot be compared or leave [0, 1].
    """
    check_comparable(arm, scratch)
    for curves in (arm, scratch):
        values = np.append(curves.returns, curves.floor)
        if values.min() < 0.0 or values.max() > 1.0:
            raise StudyError(
                "Forward transfer needs scores in [0, 1]: use Reference.scores(curves, clip=True)."
            )
    if arm.n_evals == 1:
        return undefined(_NO_CURVE)
    # Gain over headroom is one minus the ratio of the two headrooms.
    left = estimate_ratio(
        1.0 - arm.auc(),
        1.0 - scratch.auc(),
        least=MIN_HEADROOM,
        too_small=f"Undefined: scratch leaves a headroom of less than {MIN_HEADROOM:g}.",
        rng=rng,
    )
    # A headroom is never negative, but the interval can be.
    least = None if left.low is None else max(left.low, 0.0)
    value, low, high = (
        None if share is None else 1.0 - share for share in (left.value, left.high, least)
    )
    return Estimate(value, low, high, left.method, left.note)


class ReachTimes(msgspec.Struct, frozen=True):
    """Times at which the seeds of one arm reached a threshold.

    A seed that did not reach the threshold is right-censored at the horizon H, which all seeds
    share, so the Kaplan-Meier estimate equals the empirical distribution.

    Attributes:
        fraction: Share of the seeds that reached the threshold by H, from 0 to 1.
        restricted_mean: Mean of min(time, H) in steps, from 0 to H: the restricted mean survival
            time (Royston & Parmar, BMC Med. Res. Methodol. 13:152, 2013).
        restricted_median: Step by which half the seeds had reached the threshold; None if fewer
            than half reached it by H.
    """

    fraction: float
    restricted_mean: float
    restricted_median: float | None


class TimeToThreshold(msgspec.Struct, frozen=True):
    """Time to a threshold, of an arm and of scratch.

    Attributes:
        threshold: The threshold, in units of the curves.
        arm: Times of the arm; None if undefined.
        scratch: Times of scratch; None if undefined.
        steps_saved: Restricted mean of scratch minus the arm's, in steps; positive if the arm
            is faster.
    """

    threshold: float
    arm: ReachTimes | None
    scratch: ReachTimes | None
    steps_saved: Estimate


def steps_to_reach(curves: LearningCurves, threshold: float) -> NDArray[np.float64]:
    """First step at which each seed is at or above `threshold`, shape (n_seeds,).

    Curves are linear between two evaluations. The step is infinity if the threshold is not reached
    by the horizon.

    Args:
        curves: Curves in target steps or in total steps.
        threshold: The threshold, in units of the curves.
    """
    if curves.source_steps > 0.0 and curves.floor >= threshold:
        return np.zeros(curves.n_seeds)
    times = np.full(curves.n_seeds, np.inf)
    for seed, row in enumerate(curves.returns):
        above = np.flatnonzero(row >= threshold)
        if above.size:
            # The curve rises from below the threshold, so its inverse is defined here.
            around = slice(max(int(above[0]) - 1, 0), int(above[0]) + 1)
            times[seed] = np.interp(threshold, row[around], curves.steps[around])
    steps = times + curves.source_steps
    return np.where(steps <= curves.horizon, steps, np.inf)


def time_to_threshold(
    arm: LearningCurves, scratch: LearningCurves, threshold: float
) -> TimeToThreshold:
    """Taylor & Stone's time to threshold (JMLR 10, 2009, section 2), without dropping seeds.

    The times are compared by their restricted means, because a mean over the seeds that reached the
    threshold would favour the arm with the fewest such seeds.

    Args:
        arm: Curves of the arm.
        scratch: Curves of the baseline, evaluated at the same steps.
        threshold: Declared before the study, in units of the curves.

    Raises:
        StudyError: If the curves cannot be compared or the threshold is not finite.
    """
    check_comparable(arm, scratch)
    if not math.isfinite(threshold):
        raise StudyError(f"A threshold must be finite, got {threshold}.")
    if arm.n_evals == 1:
        return TimeToThreshold(threshold, None, None, undefined(_NO_CURVE))
    arm_steps = steps_to_reach(arm, threshold)
    scratch_steps = steps_to_reach(scratch, threshold)
    saved = estimate_difference(
        # Scratch comes first, because fewer steps are a gain.
        np.minimum(scratch_steps, scratch.horizon),
        np.minimum(arm_steps, arm.horizon),
    )
    return TimeToThreshold(
        threshold,
        _reach_times(arm_steps, arm.horizon),
        _reach_times(scratch_steps, scratch.horizon),
        saved,
    )


def _reach_times(steps: NDArray[np.float64], horizon: float) -> ReachTimes:
    """Summarise the steps at which seeds reached a threshold, shape (n_seeds,); inf if never."""
    half = float(np.sort(steps)[(steps.size - 1) // 2])
    return ReachTimes(
        fraction=float(np.isfinite(steps).mean()),
        restricted_mean=float(np.minimum(steps, horizon).mean()),
        restricted_median=half if math.isfinite(half) else None,
    )


# Thresholds in units of score; several, because a single one could be chosen in hindsight.
DEFAULT_THRESHOLDS: Final = (0.25, 0.5, 0.75, 0.9)

_NO_SCORES: Final = "Undefined: no arm ended above the policies without skill, so no score exists."


class Measures(msgspec.Struct, frozen=True):
    """Measures of one arm against scratch, in target steps or in total steps.

    Attributes:
        jumpstart: Initial advantage, in the unit of the summary.
        asymptotic_gain: Final advantage, in the unit of the summary.
        total_reward_gain: Mean advantage, in the unit of the summary.
        auc_ratio: Area of the arm divided by area of scratch, a pure number.
        forward_transfer: Share of scratch's headroom that the arm gains, a pure number.
        times_to_threshold: One for each threshold, in order.
    """

    jumpstart: Estimate
    asymptotic_gain: Estimate
    total_reward_gain: Estimate
    auc_ratio: Estimate
    forward_transfer: Estimate
    times_to_threshold: tuple[TimeToThreshold, ...]


class Summary(msgspec.Struct, frozen=True):
    """All measures of one arm against scratch, with their basis.

    Attributes:
        unit: Unit of the gains: "score", or "value" if no arm learned, so that there are no scores
            and only jumpstart, asymptotic gain and total reward gain are defined.
        reference: The scale of scores. A gain in values is the gain in scores times (one - zero).
        horizon: H, the budget in steps, for both ways of counting.
        source_steps: Training steps of the arm on the source.
        n_seeds_arm: Training runs of the arm.
        n_seeds_scratch: Training runs from scratch.
        last_k: Number of final evaluations that are averaged.
        confidence: Confidence of every interval.
        in_target_steps: Measures in target steps.
        in_total_steps: Measures in total steps.
    """

    unit: Literal["score", "value"]
    reference: Reference
    horizon: float
    source_steps: float
    n_seeds_arm: int
    n_seeds_scratch: int
    last_k: int
    confidence: float
    in_target_steps: Measures
    in_total_steps: Measures


def summarise(
    scratch: LearningCurves,
    arm: LearningCurves,
    reference: Reference,
    *,
    source_steps: float,
    rng: np.random.Generator,
    last_k: int,
) -> Summary:
    """Compute all measures of one arm against scratch, in target steps and in total steps.

    Args:
        scratch: Curves of the baseline, in units of return and target steps.
        arm: Curves of the arm, evaluated at the same steps. An arm that is not trained on the
            target is evaluated once at step 0, and only its jumpstart and asymptotic gain exist.
        reference: The scale of scores of the target.
        source_steps: Training steps of the arm on the source, >= 0.
        rng: Draws the resamples. Measures in target steps and in total steps use the same
            resamples, so that they are equal without source steps.
        last_k: Number of final evaluations that are averaged.

    Raises:
        StudyError: If the curves cannot be compared, or an argument is out of range.
    """
    check_comparable(arm, scratch)
    draws = int(rng.integers(2**63))

    def measure(arm: LearningCurves) -> Measures:
        """Compute all measures for curves in target steps or in total steps."""
        baseline, ratio, transfer = scratch, undefined(_NO_SCORES), undefined(_NO_SCORES)
        times = tuple(TimeToThreshold(height, None, None, ratio) for height in DEFAULT_THRESHOLDS)
        if reference.defined:
            clipped = (reference.scores(curves, clip=True) for curves in (arm, baseline))
            transfer = forward_transfer(*clipped, rng=np.random.default_rng(draws))
            arm, baseline = reference.scores(arm), reference.scores(baseline)
            ratio = auc_ratio(arm, baseline, rng=np.random.default_rng(draws))
            times = tuple(time_to_threshold(arm, baseline, at) for at in DEFAULT_THRESHOLDS)
        return Measures(
            jumpstart=jumpstart(arm, baseline),
            asymptotic_gain=asymptotic_gain(arm, baseline, last_k=last_k),
            total_reward_gain=total_reward_gain(arm, baseline),
            auc_ratio=ratio,
            forward_transfer=transfer,
            times_to_threshold=times,
        )

    return Summary(
        unit="score" if reference.defined else "value",
        reference=reference,
        horizon=scratch.horizon,
        source_steps=float(source_steps),
        n_seeds_arm=arm.n_seeds,
        n_seeds_scratch=scratch.n_seeds,
        last_k=last_k,
        confidence=CONFIDENCE,
        in_target_steps=measure(arm),
        in_total_steps=measure(in_total_steps(arm, source_steps, floor=reference.zero)),
    )
