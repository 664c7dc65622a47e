"""Intervals: agreement with scipy, and samples without an interval."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from shapechanger.transfer.metrics import (
    Estimate,
    estimate_difference,
    estimate_ratio,
    undefined,
)

ARM = np.array([0.9, 1.1, 1.0, 1.3, 0.7])
SCRATCH = np.array([0.5, 0.4, 0.7, 0.6])


def ratio(
    arm: NDArray[np.float64],
    scratch: NDArray[np.float64],
    *,
    n_resamples: int = 2000,
) -> Estimate:
    """Return `estimate_ratio` with few resamples and a least mean of 0.01."""
    return estimate_ratio(
        arm,
        scratch,
        least=0.01,
        too_small="Undefined: too small.",
        rng=np.random.default_rng(0),
        n_resamples=n_resamples,
    )


def test_welch_agrees_with_scipy() -> None:
    """Ours equals scipy's interval; scipy's test also warns about samples without spread."""
    ours = estimate_difference(ARM, SCRATCH)
    theirs = stats.ttest_ind(ARM, SCRATCH, equal_var=False).confidence_interval(0.95)
    assert ours.method == "Welch's t"
    np.testing.assert_allclose([ours.value], [ARM.mean() - SCRATCH.mean()])
    np.testing.assert_allclose([ours.low, ours.high], [theirs.low, theirs.high], rtol=1e-12)


def test_welch_by_hand() -> None:
    """Means 2 and 0, variances 1 and 1 of 3 seeds each: 2 ± t(0.975, 4) · sqrt(2/3)."""
    estimate = estimate_difference(np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.0, 1.0]))
    half = 2.7764451 * np.sqrt(2.0 / 3.0)
    assert estimate.value == 2.0
    np.testing.assert_allclose([estimate.low, estimate.high], [2 - half, 2 + half], rtol=1e-7)


def test_welch_takes_one_arm_without_spread() -> None:
    """Where one arm has no spread, the other gives the degrees of freedom."""
    estimate = estimate_difference(np.array([1.0, 2.0, 3.0]), np.zeros(5))
    half = float(stats.t.ppf(0.975, 2)) * np.sqrt(1.0 / 3.0)
    np.testing.assert_allclose([estimate.low, estimate.high], [2 - half, 2 + half])


@pytest.mark.parametrize("scratch", [SCRATCH, SCRATCH[:3]], ids=["5 and 4 seeds", "3 and 3"])
def test_studentised_bootstrap_by_the_book(scratch: NDArray[np.float64]) -> None:
    """Efron & Tibshirani's algorithm, one resample after the other.

    Of three seeds in each arm one resample in 81 has no error: far out in both tails.
    """
    arm = ARM if scratch.size > 3 else ARM[:3]
    value = arm.mean() / scratch.mean()

    def error(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
        """Delta method, as relative errors that add up."""
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


def test_many_seeds_make_the_ratio_normal() -> None:
    """With 200 seeds the interval is a normal distribution's, ± 1.96 errors."""
    rng = np.random.default_rng(1)
    arm, scratch = rng.normal(2.0, 0.2, 200), rng.normal(1.0, 0.1, 200)
    estimate = ratio(arm, scratch, n_resamples=10_000)
    assert estimate.note == ""
    half = 1.96 * 2.0 * np.hypot(0.1, 0.1) / np.sqrt(200.0)
    assert estimate.value is not None
    np.testing.assert_allclose(
        [estimate.low, estimate.high], [estimate.value - half, estimate.value + half], atol=0.006
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
        # Below the least that may be divided by in one resample of ten.
        (ARM, np.array([0.5, 0.4, -2.0, 1.5])),
        # So far below it in eight of 27 that the ratio is beyond what floats can hold.
        (ARM, np.array([0.5, 1e-310, 1e-310])),
        # Both seeds the same in half the resamples of each arm.
        (ARM[:2], SCRATCH[:2]),
        # Scratch shows no spread, and the arm none in one resample of nine, up to rounding.
        (np.array([0.1, 0.2, 0.7]), np.full(5, 0.5)),
        # Three zeros of five seeds: a ratio of zero without an error in one resample of thirteen.
        (np.array([0.0, 0.0, 0.0, 0.1, 0.2]), SCRATCH),
        # Only zeros: a ratio of exactly zero, without an error.
        (np.zeros(5), SCRATCH),
    ],
    ids=["undefined", "overflow", "two seeds", "one arm without spread", "some zeros", "all zeros"],
)
def test_unusable_resamples_are_not_dropped(
    arm: NDArray[np.float64], scratch: NDArray[np.float64]
) -> None:
    """If unusable resamples may fill a tail there is no interval, but a note."""
    estimate = ratio(arm, scratch)
    assert estimate.value == pytest.approx(arm.mean() / scratch.mean())
    assert (estimate.low, estimate.high, estimate.method) == (None, None, "none")
    assert "resamples" in estimate.note
