"""Four of the five measures of Taylor & Stone; the fifth, time to threshold, has its own file.

Source of all of them: M. E. Taylor and P. Stone, "Transfer Learning for Reinforcement Learning
Domains: A Survey", JMLR 10 (2009) 1633-1685, section 2.

With p the mean curve over seeds and H the horizon. Every function takes the arm in target steps or,
through `in_total_steps`, in total steps. Positive differences mean that transfer helped.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.transfer.metrics.curves import LearningCurves, check_comparable
from shapechanger.transfer.metrics.intervals import (
    Estimate,
    estimate_difference,
    estimate_ratio,
    undefined,
)

__all__ = [
    "NO_CURVE",
    "asymptotic_gain",
    "auc_ratio",
    "jumpstart",
    "total_reward_gain",
]

NO_CURVE: Final = "Undefined: it needs a learning curve, and there is one evaluation only."

_NOT_TRAINED: Final = "The arm is not trained on the target: its one evaluation stands for its end."

# An area of scores below this is zero with rounding.
_ZERO_AREA: Final = 1e-9


def jumpstart(
    arm: LearningCurves, scratch: LearningCurves, *, confidence: float = 0.95
) -> Estimate:
    """How much better the arm starts on the target, in units of the curves.

    p_arm(0) - p_scratch(0) in target steps. In total steps p_arm(0) - p_scratch(source_steps): what
    scratch has learnt by the time the arm has finished its source. If that is after the horizon,
    scratch's last evaluation stands for it.

    Args:
        arm: Curves of the arm; one evaluation will do.
        scratch: Curves of the baseline, evaluated at the same steps.
        confidence: Of Welch's interval.

    Raises:
        StudyError: If the curves cannot be compared.
    """
    check_comparable(arm, scratch)
    return estimate_difference(
        arm.returns[:, 0], scratch.at(arm.source_steps)[:, 0], confidence=confidence
    )


def asymptotic_gain(
    arm: LearningCurves, scratch: LearningCurves, *, last_k: int, confidence: float = 0.95
) -> Estimate:
    """How much better the arm ends, in units of the curves.

    Mean of p_arm over the last k evaluations minus that of p_scratch. In total steps the arm is
    read at the same k steps, of which its source steps are a part. The one evaluation of an arm
    that is not trained on the target stands for its end, because the policy does not change.

    Args:
        arm: Curves of the arm.
        scratch: Curves of the baseline, evaluated at the same steps.
        last_k: k, how many evaluations count as the end, >= 1. One is the definition by the letter;
            more of them take out noise.
        confidence: Of Welch's interval.

    Raises:
        StudyError: If the curves cannot be compared or have fewer than k evaluations.
    """
    check_comparable(arm, scratch)
    steps = scratch.last_steps(last_k)
    gain = estimate_difference(
        arm.at(steps).mean(axis=1), scratch.at(steps).mean(axis=1), confidence=confidence
    )
    if arm.n_evals > 1:
        return gain
    return Estimate(
        gain.value, gain.low, gain.high, gain.method, f"{_NOT_TRAINED} {gain.note}".rstrip()
    )


def total_reward_gain(
    arm: LearningCurves, scratch: LearningCurves, *, confidence: float = 0.95
) -> Estimate:
    """How much more the arm is worth over its whole life, in units of the curves.

    (∫ p_arm - ∫ p_scratch) / H by the trapezoid rule. Taylor & Stone's total reward is the area;
    divided by the horizon it is the mean height of the curve, which keeps the unit and does not
    grow with the budget.

    Args:
        arm: Curves of the arm.
        scratch: Curves of the baseline, evaluated at the same steps.
        confidence: Of Welch's interval.

    Raises:
        StudyError: If the curves cannot be compared.
    """
    check_comparable(arm, scratch)
    if arm.n_evals == 1:
        return undefined(NO_CURVE)
    return estimate_difference(arm.auc(), scratch.auc(), confidence=confidence)


def auc_ratio(
    arm: LearningCurves,
    scratch: LearningCurves,
    *,
    rng: np.random.Generator,
    confidence: float = 0.95,
    n_resamples: int = 10_000,
) -> Estimate:
    """Area under the arm's curve over area under scratch's, a pure number; 1 if they are equal.

    ∫ p_arm / ∫ p_scratch, the transfer ratio of Taylor & Stone's list. It moves with any constant
    added to the reward, so it has a meaning for scores only, where 0 is the random policy.
    Undefined unless scratch's area is above zero.

    Args:
        arm: Scores of the arm.
        scratch: Scores of the baseline, evaluated at the same steps.
        rng: Draws the resamples.
        confidence: Of the studentised bootstrap interval.
        n_resamples: Resamples of the studentised bootstrap.

    Raises:
        StudyError: If the curves cannot be compared.
    """
    check_comparable(arm, scratch)
    if arm.n_evals == 1:
        return undefined(NO_CURVE)
    return estimate_ratio(
        arm.auc(),
        scratch.auc(),
        least=_ZERO_AREA,
        too_small="Undefined: the area under scratch's curve is not above zero.",
        rng=rng,
        confidence=confidence,
        n_resamples=n_resamples,
    )
