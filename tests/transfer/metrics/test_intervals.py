"""Intervals equal hand-computed values and scipy's; some samples have no interval."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.intervals import (
    Estimate,
    estimate_difference,
    estimate_ratio,
    interquartile_mean,
    probability_of_improvement,
    undefined,
)

ARM = np.array([0.9, 1.1, 1.0, 1.3, 0.7])
SCRATCH = np.array([0.5, 0.4, 0.7, 0.6])


def ratio(
    arm: NDArray[np.float64], scratch: NDArray[np.float64], *, n_resamples: int = 2000
) -> Estimate:
    return estimate_ratio(
        arm,
        scratch,
        least=0.01,
        too_small="Undefined: too small.",
        rng=np.random.default_rng(0),
        n_resamples=n_resamples,
    )


def test_welch_agrees_with_scipy() -> None:
    ours = estimate_difference(ARM, SCRATCH)
    theirs = stats.ttest_ind(ARM, SCRATCH, equal_var=False).confidence_interval(0.95)
    assert ours.method == "Welch's t"
    np.testing.assert_allclose([ours.value], [ARM.mean() - SCRATCH.mean()])
    np.testing.assert_allclose([ours.low, ours.high], [theirs.low, theirs.high], rtol=1e-12)
    # If one arm has no spread, the degrees of freedom depend on the other arm only.
    estimate = estimate_difference(np.array([1.0, 2.0, 3.0]), np.zeros(5))
    half = float(stats.t.ppf(0.975, 2)) * np.sqrt(1.0 / 3.0)
    np.testing.assert_allclose([estimate.low, estimate.high], [2 - half, 2 + half])


@pytest.mark.parametrize("scratch", [SCRATCH, SCRATCH[:3]], ids=["5 and 4 seeds", "3 and 3"])
def test_studentised_bootstrap_by_the_book(scratch: NDArray[np.float64]) -> None:
    """Efron & Tibshirani's algorithm, one resample after the other.

    With three seeds in each arm, one resample in 81 has no error and counts as infinite.
    """
    arm = ARM if scratch.size > 3 else ARM[:3]
    value = arm.mean() / scratch.mean()

    def error(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
        """Delta method: the squares of the relative errors add up."""
        relative = [s.std(ddof=1) / np.sqrt(s.size) / s.mean() for s in (a, b)]
        return float(np.hypot(*relative) * a.mean() / b.mean())

    drawn = np.random.default_rng(0)
    arms, scratches = (
        drawn.choice(arm, (2000, arm.size)),
        drawn.choice(scratch, (2000, scratch.size)),
    )
    ts: list[float] = []
    silent = 0
    for a, b in zip(arms, scratches, strict=True):
        if len(set(a)) == len(set(b)) == 1:
            silent += 1
        else:
            ts.append((a.mean() / b.mean() - value) / error(a, b))
    outside = 0.025
    high = np.sort([*ts, *[np.inf] * silent])[int(np.ceil((1.0 - outside) * 1999))]
    low = np.sort([*ts, *[-np.inf] * silent])[int(outside * 1999)]

    ours = ratio(arm, scratch)
    assert ours.method == "studentised bootstrap"
    assert ours.value == pytest.approx(value)
    np.testing.assert_allclose(
        [ours.low, ours.high], value - np.array([high, low]) * error(arm, scratch)
    )


@pytest.mark.parametrize(
    ("arm", "scratch", "why"),
    [
        (ARM[:1], SCRATCH, "at least two seeds"),
        (ARM, SCRATCH[:1], "at least two seeds"),
        (np.full(3, 0.2), np.full(4, 0.1), "all seeds of each arm are equal"),
        # Equal up to rounding, which counts as no spread.
        (np.array([0.3, 0.1 + 0.2]), np.full(4, 0.1), "all seeds of each arm are equal"),
        # Differences too small for a variance.
        (np.array([0.0, 1e-280]), np.full(4, 0.1), "all seeds of each arm are equal"),
    ],
)
def test_unreliable_intervals_are_omitted(
    arm: NDArray[np.float64], scratch: NDArray[np.float64], why: str
) -> None:
    """One seed, or no spread, gives a value without an interval and a note."""
    for estimate in (estimate_difference(arm, scratch), ratio(arm, scratch)):
        assert estimate.value is not None
        assert (estimate.low, estimate.high, estimate.method) == (None, None, "none")
        assert why in estimate.note


def test_ratio_over_too_little_is_undefined() -> None:
    """Below `least` the ratio is undefined, with the caller's note."""
    assert ratio(ARM, np.array([0.02, -0.02])) == undefined("Undefined: too small.")


@pytest.mark.parametrize(
    ("arm", "scratch"),
    [
        # In two resamples of five, scratch is below the smallest divisor that is allowed.
        (ARM, np.array([0.5, 0.4, -2.0, 1.5])),
        # In eight resamples of 27, scratch is so small that the ratio overflows.
        (ARM, np.array([0.5, 1e-310, 1e-310])),
        # In half the resamples of each arm, both seeds are the same.
        (ARM[:2], SCRATCH[:2]),
        # Scratch has no spread, and up to rounding the arm has none in one resample of nine.
        (np.array([0.1, 0.2, 0.7]), np.full(5, 0.5)),
        # Three of five seeds are zero: one resample in thirteen has only zeros, without spread.
        (np.array([0.0, 0.0, 0.0, 0.1, 0.2]), SCRATCH),
        # All seeds are zero: the ratio is exactly zero, without spread.
        (np.zeros(5), SCRATCH),
    ],
    ids=["undefined", "overflow", "two seeds", "one arm without spread", "some zeros", "all zeros"],
)
def test_unusable_resamples_are_not_dropped(
    arm: NDArray[np.float64], scratch: NDArray[np.float64]
) -> None:
    """If the unusable resamples could fill a tail, there is a note instead of an interval."""
    estimate = ratio(arm, scratch)
    assert estimate.value == pytest.approx(arm.mean() / scratch.mean())
    assert (estimate.low, estimate.high, estimate.method) == (None, None, "none")
    assert "resamples" in estimate.note


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_the_middle_half_is_averaged() -> None:
    """The interquartile mean of eight runs ignores the two lowest and the two highest."""
    groups = [np.array([0.0, 1.0, 2.0, 100.0]), np.array([-50.0, 3.0, 4.0, 5.0])]
    found = interquartile_mean(groups, rng=_rng())
    assert found.value == pytest.approx((1.0 + 2.0 + 3.0 + 4.0) / 4)
    assert found.low is not None
    assert found.high is not None
    assert found.low <= found.value <= found.high
    assert found.method == "stratified bootstrap"


def test_improvement_matches_mann_whitney() -> None:
    """The value is U per pair of runs, averaged over studies; equal runs count half."""
    rng = np.random.default_rng(1)
    arm, scratch = rng.normal(0.5, 1.0, 7), rng.normal(0.0, 1.0, 5)
    one = probability_of_improvement([arm], [scratch], rng=_rng())
    u = stats.mannwhitneyu(arm, scratch).statistic
    assert one.value == pytest.approx(u / 35)
    both = probability_of_improvement([arm, np.ones(2)], [scratch, np.ones(3)], rng=_rng())
    assert both.value == pytest.approx((u / 35 + 0.5) / 2)


def test_intervals_are_quantiles_of_the_resamples() -> None:
    """The interval is from 2.5 to 97.5 % of resampled means over studies."""
    rng = np.random.default_rng(1)
    arm, scratch = ([rng.normal(level, 1.0, 4) for level in (0.4, 0.0)] for _ in range(2))
    found = probability_of_improvement(arm, scratch, rng=_rng())
    again, means = _rng(), np.zeros(2000)
    for x, y in zip(arm, scratch, strict=True):
        xs, ys = (g[again.integers(g.size, size=(2000, g.size))] for g in (x, y))
        means += [(a[:, None] > b).mean() / 2 for a, b in zip(xs, ys, strict=True)]
    assert (found.low, found.high) == pytest.approx(tuple(np.quantile(means, [0.025, 0.975])))


def test_runs_are_drawn_within_their_study() -> None:
    """Different levels of studies do not widen the interval."""
    steady = [np.full(5, level) for level in (0.0, 1.0, 2.0)]
    found = interquartile_mean(steady, rng=_rng())
    assert found.low == found.high == found.value == pytest.approx(1.0)


def test_missing_runs_are_refused() -> None:
    one = np.ones(2)
    for groups in ([], [np.empty(0)]):
        with pytest.raises(StudyError, match="at least one run"):
            interquartile_mean(groups, rng=_rng())
    with pytest.raises(StudyError, match="1 studies of the arm and 2 of scratch"):
        probability_of_improvement([one], [one, one], rng=_rng())
