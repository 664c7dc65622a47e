"""Intervals: agreement with scipy, and honesty where there is nothing to say."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import (
    Estimate,
    estimate_difference,
    estimate_ratio,
    undefined,
)

ARM = np.array([0.9, 1.1, 1.0, 1.3, 0.7])
SCRATCH = np.array([0.5, 0.4, 0.7, 0.6])


def quotient(arm: NDArray[np.float64], scratch: NDArray[np.float64]) -> NDArray[np.float64]:
    """A ratio that is undefined where the denominator is not above zero."""
    return np.divide(arm, scratch, out=np.full_like(arm, np.nan), where=scratch > 0.0)


def ratio(arm: NDArray[np.float64], scratch: NDArray[np.float64], seed: int = 0) -> Estimate:
    """The ratio of two samples, with few resamples."""
    return estimate_ratio(quotient, arm, scratch, rng=np.random.default_rng(seed), n_resamples=2000)


@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.99])
def test_welch_agrees_with_scipy(confidence: float) -> None:
    """The six lines here are scipy's Welch test, which warns where these need not."""
    ours = estimate_difference(ARM, SCRATCH, confidence=confidence)
    theirs = stats.ttest_ind(ARM, SCRATCH, equal_var=False).confidence_interval(confidence)
    assert ours.method == "welch"
    np.testing.assert_allclose([ours.value], [ARM.mean() - SCRATCH.mean()])
    np.testing.assert_allclose([ours.low, ours.high], [theirs.low, theirs.high], rtol=1e-12)


def test_welch_by_hand() -> None:
    """Means 2 and 0, variances 1 and 1 of 3 seeds each: 2 ± t(0.975, 4) · sqrt(2/3)."""
    estimate = estimate_difference(np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.0, 1.0]))
    half = 2.7764451 * np.sqrt(2.0 / 3.0)
    assert estimate.value == 2.0
    np.testing.assert_allclose([estimate.low, estimate.high], [2 - half, 2 + half], rtol=1e-7)


def test_welch_takes_one_arm_without_spread() -> None:
    """Seeds that all hit the horizon leave the other arm's degrees of freedom."""
    estimate = estimate_difference(np.array([1.0, 2.0, 3.0]), np.zeros(5))
    half = float(stats.t.ppf(0.975, 2)) * np.sqrt(1.0 / 3.0)
    np.testing.assert_allclose([estimate.low, estimate.high], [2 - half, 2 + half])


def test_bca_agrees_with_scipy() -> None:
    """The interval is `scipy.stats.bootstrap` of two unpaired samples, and it holds the ratio."""
    ours = ratio(ARM, SCRATCH)
    theirs = stats.bootstrap(
        (ARM, SCRATCH),
        lambda x, y, axis: x.mean(axis=axis) / y.mean(axis=axis),
        n_resamples=2000,
        rng=np.random.default_rng(0),
    ).confidence_interval
    assert ours.method == "bca"
    assert ours.value == pytest.approx(ARM.mean() / SCRATCH.mean())
    np.testing.assert_allclose([ours.low, ours.high], [theirs.low, theirs.high])
    assert ours.low is not None
    assert ours.high is not None
    assert ours.low < ARM.mean() / SCRATCH.mean() < ours.high


def test_few_seeds_are_told_that_bca_is_narrow() -> None:
    """What 95 % means with five seeds stands next to the interval, and not with twenty."""
    rng = np.random.default_rng(1)
    assert "87 %" in ratio(ARM, SCRATCH).note
    assert ratio(rng.normal(2.0, 0.1, 20), rng.normal(1.0, 0.1, 20)).note == ""


def test_same_generator_same_interval() -> None:
    """The draws come from the generator that is passed and from nowhere else."""
    assert ratio(ARM, SCRATCH, seed=3) == ratio(ARM, SCRATCH, seed=3)
    assert ratio(ARM, SCRATCH, seed=3) != ratio(ARM, SCRATCH, seed=4)


@pytest.mark.parametrize(
    ("arm", "scratch", "why"),
    [
        (ARM[:1], SCRATCH, "at least two seeds"),
        (ARM, SCRATCH[:1], "at least two seeds"),
        (np.full(3, 0.2), np.full(4, 0.1), "all seeds equal"),
        # Equal up to rounding, which is no spread either.
        (np.array([0.3, 0.1 + 0.2]), np.full(4, 0.1), "all seeds equal"),
        # So near to nothing that a variance could not tell.
        (np.array([0.0, 1e-280]), np.full(4, 0.1), "all seeds equal"),
    ],
)
def test_no_interval_is_better_than_a_false_one(
    arm: NDArray[np.float64], scratch: NDArray[np.float64], why: str
) -> None:
    """One seed, or no spread at all, leaves the point and a reason."""
    for estimate in (estimate_difference(arm, scratch), ratio(arm, scratch)):
        assert estimate.value is not None
        assert (estimate.low, estimate.high, estimate.method) == (None, None, "none")
        assert why in estimate.note


def test_ratio_undefined_in_some_resamples_has_no_interval() -> None:
    """A denominator that may be zero leaves the ratio unbounded; the point remains."""
    estimate = ratio(ARM, np.array([0.5, 0.4, -2.0, 1.5]))
    assert estimate.value == pytest.approx(10.0)
    assert (estimate.low, estimate.high, estimate.method) == (None, None, "none")
    assert "resamples" in estimate.note


def test_degenerate_bca_is_noticed() -> None:
    """Two resamples on one side of the value: a reason instead of a number or a warning."""
    estimate = estimate_ratio(quotient, ARM, SCRATCH, rng=np.random.default_rng(0), n_resamples=2)
    assert estimate.value == pytest.approx(1.0 / 0.55)
    assert estimate.low is None
    assert "BCa is undefined" in estimate.note


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0, np.nan])
def test_confidence_is_a_share(confidence: float) -> None:
    """95 is not 0.95."""
    with pytest.raises(StudyError, match=r"such as 0\.95"):
        estimate_difference(ARM, SCRATCH, confidence=confidence)
    with pytest.raises(StudyError, match=r"such as 0\.95"):
        estimate_ratio(quotient, ARM, SCRATCH, rng=np.random.default_rng(0), confidence=confidence)


def test_one_resample_is_no_bootstrap() -> None:
    """The fewest that have a spread are two."""
    with pytest.raises(StudyError, match="at least two resamples, got 1"):
        estimate_ratio(quotient, ARM, SCRATCH, rng=np.random.default_rng(0), n_resamples=1)


def test_estimates_survive_json() -> None:
    """Undefined is null on the wire, never NaN, which JSON does not have."""
    for estimate in (undefined("Undefined: because."), estimate_difference(ARM, SCRATCH)):
        assert msgspec.json.decode(msgspec.json.encode(estimate), type=Estimate) == estimate
    assert b'"value":null' in msgspec.json.encode(undefined("Undefined: because."))
