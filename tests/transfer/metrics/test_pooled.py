"""Statistics over several studies: by hand, against scipy, and their coverage."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics import interquartile_mean, probability_of_improvement

_Groups = list[NDArray[np.float64]]


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_the_middle_half_is_averaged() -> None:
    """Of eight runs the two lowest and the two highest do not count."""
    groups = [np.array([0.0, 1.0, 2.0, 100.0]), np.array([-50.0, 3.0, 4.0, 5.0])]
    found = interquartile_mean(groups, rng=_rng())
    assert found.value == pytest.approx((1.0 + 2.0 + 3.0 + 4.0) / 4)
    assert found.low is not None
    assert found.high is not None
    assert found.low <= found.value <= found.high
    assert found.method == "stratified bootstrap"


def test_improvement_matches_mann_whitney() -> None:
    """U over the number of pairs, averaged over studies; equal runs count half."""
    rng = np.random.default_rng(1)
    arm, scratch = rng.normal(0.5, 1.0, 7), rng.normal(0.0, 1.0, 5)
    one = probability_of_improvement([arm], [scratch], rng=_rng())
    u = stats.mannwhitneyu(arm, scratch).statistic
    assert one.value == pytest.approx(u / 35)
    both = probability_of_improvement([arm, np.ones(2)], [scratch, np.ones(3)], rng=_rng())
    assert both.value == pytest.approx((u / 35 + 0.5) / 2)


def test_intervals_are_quantiles_of_the_resamples() -> None:
    """From 2.5 to 97.5 %, of means over studies."""
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


def test_intervals_hold_over_many_studies() -> None:
    """With twelve studies of five runs the coverage is close to 95 %."""
    rng, held, trials = np.random.default_rng(2), 0, 100
    for _ in range(trials):
        arm = [rng.normal(0.0, 1.0, 5) for _ in range(12)]
        scratch = [rng.normal(0.0, 1.0, 5) for _ in range(12)]
        found = probability_of_improvement(arm, scratch, rng=rng)
        assert found.low is not None
        assert found.high is not None
        held += found.low <= 0.5 <= found.high
    assert held >= 0.88 * trials


@pytest.mark.parametrize("groups", [[], [np.empty(0)]])
def test_no_runs_are_refused(groups: _Groups) -> None:
    with pytest.raises(StudyError, match="at least one run"):
        interquartile_mean(groups, rng=_rng())


def test_the_number_of_studies_must_match() -> None:
    one = np.ones(2)
    with pytest.raises(StudyError, match="1 studies of the arm and 2 of scratch"):
        probability_of_improvement([one], [one, one], rng=_rng())
