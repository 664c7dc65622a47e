"""Estimates with confidence intervals: over the seeds of one study, and over several studies.

Each arm is one sample of independent seeds. Sizes may differ, and arms are not paired. The
arguments are one number for each seed. docs/statistics.md compares the coverage of these and other
intervals with few seeds.

Interquartile mean and probability of improvement follow R. Agarwal and others, "Deep Reinforcement
Learning at the Edge of the Statistical Precipice", NeurIPS 2021. Their intervals are percentiles of
a stratified bootstrap: it draws runs with replacement within each study, because runs are
independent and studies are not a random sample. These intervals are too narrow if there are few
studies with few seeds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from shapechanger.errors import StudyError

_Groups = Sequence[NDArray[np.float64]]
IntervalKind = Literal["Welch's t", "studentised bootstrap", "stratified bootstrap", "none"]

CONFIDENCE: Final = 0.95
"""Confidence of the intervals of studies."""

# Numbers with a smaller relative difference are equal up to rounding.
_ROUNDING: Final = 1e-12
# Quotients of squares of smaller spreads would underflow.
_LEAST_SPREAD: Final = 1e-60
# Share of the runs that an interquartile mean leaves out at each end.
_TRIMMED: Final = 0.25
_POOLED_RESAMPLES: Final = 2000
_NO_TAILS: Final = "No interval: too many resamples have no ratio or no spread."


class Estimate(msgspec.Struct, frozen=True):
    """An estimate with a confidence interval.

    Attributes:
        value: The estimate; None if the measure is undefined, with the reason in `note`.
        low: Lower end of the interval; None if there is no interval, with the reason in `note`.
        high: Upper end of the interval.
        method: Kind of interval.
        note: A remark; may be empty.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    method: IntervalKind = "none"
    note: str = ""


def undefined(note: str) -> Estimate:
    """Return an undefined measure with the reason."""
    return Estimate(value=None, note=note)


def estimate_difference(arm: NDArray[np.float64], scratch: NDArray[np.float64]) -> Estimate:
    """Difference of means, arm minus scratch, with Welch's t-interval.

    difference ± t(0.95, df) · sqrt(s_arm² / n_arm + s_scratch² / n_scratch), with the
    degrees of freedom of Welch (Biometrika 34, 1947) and Satterthwaite. The percentile bootstrap of
    rliable (Agarwal et al., NeurIPS 2021) is made for scores pooled over many tasks. With five
    seeds in each arm, its 95 % interval covers about 87 %, and Welch's 95 %.

    Args:
        arm: One number for each seed of the arm, shape (n_arm,).
        scratch: One number for each seed of scratch, shape (n_scratch,).
    """
    value = float(arm.mean() - scratch.mean())
    if no_interval := _why_no_interval(arm, scratch):
        return Estimate(value, note=no_interval)
    squares = np.array([arm.var(ddof=1) / arm.size, scratch.var(ddof=1) / scratch.size])
    shares = squares / squares.sum()
    freedom = 1.0 / float((shares**2 / np.array([arm.size - 1, scratch.size - 1])).sum())
    half = float(stdtrit(freedom, 0.5 + CONFIDENCE / 2.0)) * math.sqrt(float(squares.sum()))
    return Estimate(value, value - half, value + half, "Welch's t")


def estimate_ratio(
    arm: NDArray[np.float64],
    scratch: NDArray[np.float64],
    *,
    least: float,
    too_small: str,
    rng: np.random.Generator,
    n_resamples: int = 10_000,
) -> Estimate:
    """Ratio of means, arm divided by scratch, with its studentised bootstrap interval.

    The seeds of each arm are resampled separately, with replacement. Each resample b gives
    t_b = (ratio_b - ratio) / error_b, with the standard error of a ratio by the delta method, and
    the interval is from ratio - t(high) · error to ratio - t(low) · error, with the quantiles of
    all t_b instead of Student's (B. Efron and R. J. Tibshirani, "An Introduction to the
    Bootstrap", 1993, section 12.5).

    A resample has no t_b if its error is zero, because all drawn seeds are equal, or if its mean of
    scratch is below `least`. Without these resamples the interval would be too narrow, so they
    count as infinite in both tails. If they fill a tail, there is no interval, and the note states
    this. With two seeds in each arm, a quarter of the resamples has no t_b.

    Args:
        arm: One number for each seed, shape (n_arm,).
        scratch: The same, shape (n_scratch,).
        least: Smallest mean of scratch for which the ratio is defined, > 0.
        too_small: Note of the estimate if the mean of scratch is below `least`.
        rng: Draws the resamples.
        n_resamples: Number of resamples, at least 40, so that each tail has one; thousands for an
            interval that hardly depends on `rng`.
    """
    if not scratch.mean() >= least:
        return undefined(too_small)
    if no_interval := _why_no_interval(arm, scratch):
        return Estimate(float(arm.mean() / scratch.mean()), note=no_interval)
    ratio, error = (float(number) for number in _ratio(arm, scratch))
    arms = rng.choice(arm, (n_resamples, arm.size))
    scratches = rng.choice(scratch, (n_resamples, scratch.size))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratios, errors = _ratio(arms, scratches)
        t = (ratios - ratio) / errors
    usable = (scratches.mean(axis=-1) >= least) & (_spread(arms) | _spread(scratches))
    usable &= errors > 0.0  # The error is also zero if all numbers of the arm are zero.
    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(np.quantile(np.where(usable, t, -np.inf), tail, method="lower"))
    high = float(np.quantile(np.where(usable, t, np.inf), 1.0 - tail, method="higher"))
    if not (math.isfinite(low) and math.isfinite(high)):
        return Estimate(ratio, note=_NO_TAILS)
    return Estimate(ratio, ratio - high * error, ratio - low * error, "studentised bootstrap")


def _ratio(
    arm: NDArray[np.float64], scratch: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ratio of means along the last axis, and its standard error.

    error² = (s_arm² / n_arm + ratio² · s_scratch² / n_scratch) / mean_scratch², the delta method
    for two independent means. Each arm needs at least two seeds.
    """
    below = scratch.mean(axis=-1)
    ratio = arm.mean(axis=-1) / below
    square = _squared_error(arm) + ratio**2 * _squared_error(scratch)
    return ratio, np.sqrt(square) / np.abs(below)


def _squared_error(sample: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(sample.var(axis=-1, ddof=1)) / sample.shape[-1]


def _why_no_interval(arm: NDArray[np.float64], scratch: NDArray[np.float64]) -> str:
    """Return the reason why these samples have no interval; empty if they have one."""
    if min(arm.size, scratch.size) < 2:
        return "No interval: each arm needs at least two seeds."
    if not (_spread(arm) | _spread(scratch)):
        return "No interval: all seeds of each arm are equal, so their spread is unknown."
    return ""


def _spread(sample: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return whether the numbers along the last axis differ by more than rounding."""
    size = np.abs(sample).max(axis=-1)
    return np.asarray(np.ptp(sample, axis=-1) > np.maximum(_LEAST_SPREAD, _ROUNDING * size))


def interquartile_mean(scores: _Groups, *, rng: np.random.Generator) -> Estimate:
    """Mean of the middle half of all runs, in units of score.

    Args:
        scores: One array for each study, with one number for each run, shape (n_runs,).
        rng: Draws the resamples.

    Raises:
        StudyError: If there are no runs.
    """
    from scipy import stats  # Takes a second to load.

    _require_runs(scores)
    mean: Any = stats.trim_mean(np.concatenate(scores), _TRIMMED)
    drawn = np.concatenate([_drawn(group, rng) for group in scores], axis=1)
    means: Any = stats.trim_mean(drawn, _TRIMMED, axis=1)
    return _between(float(mean), means)


def probability_of_improvement(
    arm: _Groups, scratch: _Groups, *, rng: np.random.Generator
) -> Estimate:
    """Probability that a run of the arm ends above a run of scratch, averaged over studies.

    Equal runs count half (Mann & Whitney, 1947). 0.5 means no effect.

    Args:
        arm: One array for each study, with one number for each run of the arm.
        scratch: One array for each study, in the same order, with one number for each scratch run.
        rng: Draws the resamples.

    Raises:
        StudyError: If there are no runs, or `arm` and `scratch` have different lengths.
    """
    _require_runs(arm)
    _require_runs(scratch)
    if len(arm) != len(scratch):
        raise StudyError(f"There are {len(arm)} studies of the arm and {len(scratch)} of scratch.")
    pairs = list(zip(arm, scratch, strict=True))
    chances = [_chance(_drawn(x, rng), _drawn(y, rng)) for x, y in pairs]
    value = np.mean([_chance(x[None], y[None]) for x, y in pairs])
    return _between(float(value), np.mean(chances, axis=0))


def _chance(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the share of pairs (x, y) along the last axes with x > y; equal pairs count half."""
    return 0.5 + 0.5 * np.sign(x[:, :, None] - y[:, None, :]).mean(axis=(1, 2))


def _require_runs(groups: _Groups) -> None:
    if not groups or any(group.size == 0 for group in groups):
        raise StudyError("Each study needs at least one run.")


def _drawn(group: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    return group[rng.integers(group.size, size=(_POOLED_RESAMPLES, group.size))]


def _between(value: float, draws: NDArray[np.float64]) -> Estimate:
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = (float(np.quantile(draws, q)) for q in (tail, 1.0 - tail))
    return Estimate(value, low, high, "stratified bootstrap")
