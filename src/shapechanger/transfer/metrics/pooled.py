"""Statistics over the runs of several studies: interquartile mean, probability of improvement.

Both follow R. Agarwal and others, "Deep Reinforcement Learning at the Edge of the Statistical
Precipice", NeurIPS 2021. Their intervals are percentiles of a bootstrap that is stratified: it
draws runs with replacement within each study, because runs are independent and studies are not a
sample of anything. With few studies of few seeds they are too narrow, see docs/statistics.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.intervals import CONFIDENCE, Estimate

# A quarter of the runs is left out at each end.
_TRIMMED = 0.25

_Groups = Sequence[NDArray[np.float64]]


def interquartile_mean(
    scores: _Groups,
    *,
    rng: np.random.Generator,
    n_resamples: int = 2000,
) -> Estimate:
    """Mean of the middle half of all runs, in units of score.

    Args:
        scores: For each study one number for each run, shape (n_runs,).
        rng: Draws the resamples.
        n_resamples: Number of resamples.

    Raises:
        StudyError: If there are no runs.
    """
    from scipy import stats  # It takes a second to load.

    _require_runs(scores)
    mean: Any = stats.trim_mean(np.concatenate(scores), _TRIMMED)
    drawn = np.concatenate([_drawn(group, n_resamples, rng) for group in scores], axis=1)
    means: Any = stats.trim_mean(drawn, _TRIMMED, axis=1)
    return _between(float(mean), means)


def probability_of_improvement(
    arm: _Groups,
    scratch: _Groups,
    *,
    rng: np.random.Generator,
    n_resamples: int = 2000,
) -> Estimate:
    """Probability that a run of the arm ends above a run of scratch, averaged over studies.

    Equal runs count half (Mann & Whitney, 1947). 0.5 means no effect.

    Args:
        arm: For each study one number for each run of the arm.
        scratch: The same of scratch, in the same order of studies.
        rng: Draws the resamples.
        n_resamples: Number of resamples.

    Raises:
        StudyError: If there are no runs, or not as many studies of both.
    """
    _require_runs(arm)
    _require_runs(scratch)
    if len(arm) != len(scratch):
        raise StudyError(f"There are {len(arm)} studies of the arm and {len(scratch)} of scratch.")

    chances = [
        _chance(_drawn(x, n_resamples, rng), _drawn(y, n_resamples, rng))
        for x, y in zip(arm, scratch, strict=True)
    ]
    value = np.mean([_chance(x[None], y[None]) for x, y in zip(arm, scratch, strict=True)])
    return _between(float(value), np.mean(chances, axis=0))


def _chance(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of the pairs along the last axes in which x is above y; equal ones count half."""
    return 0.5 + 0.5 * np.sign(x[:, :, None] - y[:, None, :]).mean(axis=(1, 2))


def _require_runs(groups: Sequence[NDArray[np.float64]]) -> None:
    """Refuse studies without runs."""
    if not groups or any(group.size == 0 for group in groups):
        raise StudyError("Each study needs at least one run.")


def _drawn(
    group: NDArray[np.float64], n_resamples: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    return group[rng.integers(group.size, size=(n_resamples, group.size))]


def _between(value: float, draws: NDArray[np.float64]) -> Estimate:
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = (float(np.quantile(draws, q)) for q in (tail, 1.0 - tail))
    return Estimate(value, low, high, "stratified bootstrap")
