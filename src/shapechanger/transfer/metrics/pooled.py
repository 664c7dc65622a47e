"""Statistics over the runs of several studies: interquartile mean, probability of improvement.

Both are those of R. Agarwal and others, "Deep Reinforcement Learning at the Edge of the Statistical
Precipice", NeurIPS 2021. Their intervals are percentiles of a bootstrap that is stratified: it
draws runs anew within each study, because runs are independent and studies are not a sample of
anything. With few studies of few seeds they are too narrow, see docs/statistics.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.intervals import Estimate

__all__ = ["interquartile_mean", "probability_of_improvement"]

# A quarter of the runs is left out at each end.
_TRIMMED = 0.25

_Groups = Sequence[NDArray[np.float64]]


def interquartile_mean(
    scores: _Groups,
    *,
    rng: np.random.Generator,
    confidence: float = 0.95,
    n_resamples: int = 2000,
) -> Estimate:
    """Mean of the middle half of all runs, in units of score.

    Args:
        scores: For each study one number for each run, shape (n_runs,).
        rng: Draws the resamples.
        confidence: Confidence of the interval, between 0 and 1.
        n_resamples: Number of resamples.

    Raises:
        StudyError: If there are no runs.
    """
    _require_runs(scores)

    def trimmed(groups: _Groups) -> float:
        mean: Any = stats.trim_mean(np.concatenate(groups), _TRIMMED)
        return float(mean)

    draws: list[float] = [
        trimmed([_drawn(group, rng) for group in scores]) for _ in range(n_resamples)
    ]
    return _between(trimmed(scores), draws, confidence)


def probability_of_improvement(
    arm: _Groups,
    scratch: _Groups,
    *,
    rng: np.random.Generator,
    confidence: float = 0.95,
    n_resamples: int = 2000,
) -> Estimate:
    """Probability that a run of the arm ends above a run of scratch, averaged over studies.

    Equal runs count half (Mann & Whitney, 1947). 0.5 means no effect.

    Args:
        arm: For each study one number for each run of the arm.
        scratch: The same of scratch, in the same order of studies.
        rng: Draws the resamples.
        confidence: Confidence of the interval, between 0 and 1.
        n_resamples: Number of resamples.

    Raises:
        StudyError: If there are no runs, or not as many studies of both.
    """
    _require_runs(arm)
    _require_runs(scratch)
    if len(arm) != len(scratch):
        raise StudyError(f"There are {len(arm)} studies of the arm and {len(scratch)} of scratch.")

    def above(ours: _Groups, theirs: _Groups) -> float:
        shares: list[float] = []
        for x, y in zip(ours, theirs, strict=True):
            difference = np.subtract.outer(x, y)
            shares.append(float(np.mean(0.5 + 0.5 * np.sign(difference))))
        return float(np.mean(shares))

    draws = [
        above([_drawn(x, rng) for x in arm], [_drawn(y, rng) for y in scratch])
        for _ in range(n_resamples)
    ]
    return _between(above(arm, scratch), draws, confidence)


def _require_runs(groups: Sequence[NDArray[np.float64]]) -> None:
    """Refuse studies without runs."""
    if not groups or any(group.size == 0 for group in groups):
        raise StudyError("Each study needs at least one run.")


def _drawn(group: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    return group[rng.integers(group.size, size=group.size)]


def _between(value: float, draws: Sequence[float], confidence: float) -> Estimate:
    tail = (1.0 - confidence) / 2.0
    low, high = (float(np.quantile(np.array(draws), q)) for q in (tail, 1.0 - tail))
    return Estimate(value, low, high, "stratified bootstrap")
