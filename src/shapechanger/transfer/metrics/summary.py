"""Everything that is measured of one arm, as data that can be written down."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import msgspec
import numpy as np

from shapechanger.transfer.metrics.curves import LearningCurves, check_comparable, in_total_steps
from shapechanger.transfer.metrics.forward_transfer import forward_transfer
from shapechanger.transfer.metrics.intervals import Estimate, undefined
from shapechanger.transfer.metrics.scores import Reference
from shapechanger.transfer.metrics.taylor_stone import (
    asymptotic_gain,
    auc_ratio,
    jumpstart,
    total_reward_gain,
)
from shapechanger.transfer.metrics.thresholds import TimeToThreshold, time_to_threshold

__all__ = ["DEFAULT_THRESHOLDS", "Measures", "Summary", "summarise"]

# A grid instead of one height, because one height can be chosen to please. In units of score.
DEFAULT_THRESHOLDS: Final = (0.25, 0.5, 0.75, 0.9)

_NO_SCORES: Final = "Undefined: scratch did not end above the random policy, so there is no score."


class Measures(msgspec.Struct, frozen=True):
    """The measures of one arm against scratch, in one way of counting steps.

    Attributes:
        jumpstart: How much better the arm starts, in the unit of the summary.
        asymptotic_gain: How much better it ends, in the unit of the summary.
        total_reward_gain: How much more it is worth on the way, in the unit of the summary.
        auc_ratio: Area of the arm over area of scratch, a pure number.
        forward_transfer: Share of scratch's headroom that the arm wins, a pure number.
        times_to_threshold: One for each declared threshold, in the order of declaration.
    """

    jumpstart: Estimate
    asymptotic_gain: Estimate
    total_reward_gain: Estimate
    auc_ratio: Estimate
    forward_transfer: Estimate
    times_to_threshold: tuple[TimeToThreshold, ...]


class Summary(msgspec.Struct, frozen=True):
    """All measures of one arm against scratch, and what they rest on.

    Attributes:
        unit: Unit of the gains: "score", or "return" where scratch did not learn, so that there
            are no scores and only jumpstart, asymptotic gain and total reward gain exist.
        reference: The scale of scores. A gain in returns is one in scores times final - random.
        horizon: H, the budget in steps that both ways of counting share.
        source_steps: Steps the arm spent on the source.
        n_seeds_arm: Training runs of the arm.
        n_seeds_scratch: Training runs from scratch.
        last_k: How many evaluations count as the end.
        confidence: Of every interval.
        in_target_steps: Only steps on the target count.
        in_total_steps: Steps on the source count too.
    """

    unit: Literal["score", "return"]
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
    thresholds: Sequence[float] = DEFAULT_THRESHOLDS,
    last_k: int = 5,
    confidence: float = 0.95,
    n_resamples: int = 10_000,
) -> Summary:
    """Measure one arm against scratch, in target steps and in total steps.

    Args:
        scratch: Curves of the baseline, in units of return and target steps.
        arm: Curves of the arm, evaluated at the same steps; or once at step 0 for an arm that is
            not trained on the target, of which jumpstart and asymptotic gain are defined.
        reference: The target's own scale.
        source_steps: Steps the arm spent on the source, >= 0.
        rng: Draws the resamples. Both ways of counting use the same ones, so that with no source
            steps they agree to the last digit.
        thresholds: Declared heights, in units of score.
        last_k: How many of the last evaluations count as the end.
        confidence: Of every interval, between 0 and 1.
        n_resamples: Resamples of each bootstrap interval.

    Raises:
        StudyError: If the curves cannot be compared, or an argument is out of range.
    """
    check_comparable(arm, scratch)
    draws = int(rng.integers(2**63))

    def measure(counted: LearningCurves) -> Measures:
        return _measure(
            counted, scratch, reference, thresholds, last_k, draws, confidence, n_resamples
        )

    return Summary(
        unit="score" if reference.defined else "return",
        reference=reference,
        horizon=scratch.horizon,
        source_steps=float(source_steps),
        n_seeds_arm=arm.n_seeds,
        n_seeds_scratch=scratch.n_seeds,
        last_k=last_k,
        confidence=confidence,
        in_target_steps=measure(arm),
        in_total_steps=measure(in_total_steps(arm, source_steps, floor=reference.random)),
    )


def _measure(
    arm: LearningCurves,
    scratch: LearningCurves,
    reference: Reference,
    thresholds: Sequence[float],
    last_k: int,
    draws: int,
    confidence: float,
    n_resamples: int,
) -> Measures:
    """All measures in one way of counting; the curves are in units of return."""
    ratio, transfer = undefined(_NO_SCORES), undefined(_NO_SCORES)
    times = tuple(TimeToThreshold(height, None, None, ratio) for height in thresholds)
    if reference.defined:
        transfer = forward_transfer(
            reference.scores(arm, clip=True),
            reference.scores(scratch, clip=True),
            rng=np.random.default_rng(draws),
            confidence=confidence,
            n_resamples=n_resamples,
        )
        arm, scratch = reference.scores(arm), reference.scores(scratch)
        ratio = auc_ratio(
            arm,
            scratch,
            rng=np.random.default_rng(draws),
            confidence=confidence,
            n_resamples=n_resamples,
        )
        times = tuple(
            time_to_threshold(arm, scratch, height, confidence=confidence) for height in thresholds
        )
    return Measures(
        jumpstart=jumpstart(arm, scratch, confidence=confidence),
        asymptotic_gain=asymptotic_gain(arm, scratch, last_k=last_k, confidence=confidence),
        total_reward_gain=total_reward_gain(arm, scratch, confidence=confidence),
        auc_ratio=ratio,
        forward_transfer=transfer,
        times_to_threshold=times,
    )
