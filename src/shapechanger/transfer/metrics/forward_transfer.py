"""Forward transfer: the share of what scratch leaves to be won that the arm wins."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.curves import LearningCurves, check_comparable
from shapechanger.transfer.metrics.intervals import Estimate, estimate_ratio, undefined
from shapechanger.transfer.metrics.taylor_stone import NO_CURVE

__all__ = ["LEAST_HEADROOM", "forward_transfer"]

# The measure divides by the headroom 1 - AUC_b: below one hundredth of the scale, a difference of
# 0.01 in the areas, less than runs differ by chance, would already count as a transfer of 1.
LEAST_HEADROOM: Final = 0.01


def forward_transfer(
    arm: LearningCurves,
    scratch: LearningCurves,
    *,
    rng: np.random.Generator,
    confidence: float = 0.95,
    n_resamples: int = 10_000,
) -> Estimate:
    """Forward transfer of Continual World, a pure number of at most 1; 0 means no effect.

    (AUC - AUC_b) / (1 - AUC_b), with AUC of the arm and AUC_b of scratch, both areas divided by the
    horizon (Wołczyk et al., "Continual World", NeurIPS 2021). 1 is the most that can be reached
    only if no score passes 1; there the scores are success rates, here they are clipped. Undefined
    where scratch leaves less than `LEAST_HEADROOM`.

    Args:
        arm: Scores of the arm from `Reference.scores(..., clip=True)`.
        scratch: Scores of the baseline, clipped too and evaluated at the same steps.
        rng: Draws the resamples.
        confidence: Of the studentised bootstrap interval.
        n_resamples: Resamples of the studentised bootstrap.

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
        return undefined(NO_CURVE)
    # Gain over headroom is one minus the ratio of what the two arms leave to be won.
    left = estimate_ratio(
        1.0 - arm.auc(),
        1.0 - scratch.auc(),
        least=LEAST_HEADROOM,
        too_small=f"Undefined: scratch leaves less than {LEAST_HEADROOM:g} to be won.",
        rng=rng,
        confidence=confidence,
        n_resamples=n_resamples,
    )
    return Estimate(
        _rest(left.value),
        _rest(left.high),
        # No arm leaves less than nothing, though the interval does not know.
        None if left.low is None else _rest(max(left.low, 0.0)),
        left.method,
        left.note,
    )


def _rest(share: float | None) -> float | None:
    """One minus a share, or None."""
    return None if share is None else 1.0 - share
