"""The numbers about coverage that docstrings and notes claim, measured."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from shapechanger.transfer.metrics import Estimate, estimate_difference, estimate_ratio

TRIALS = 2000

# Arms as they come out of studies: scores with a mean and a spread over seeds of each arm.
ARM, SCRATCH = (0.8, 0.1), (0.5, 0.1)


def draw(n_seeds: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scores of both arms in many studies, each of shape (TRIALS, n_seeds)."""
    rng = np.random.default_rng(seed)
    return rng.normal(*ARM, (TRIALS, n_seeds)), rng.normal(*SCRATCH, (TRIALS, n_seeds))


def coverage(estimates: list[Estimate], truth: float) -> float:
    """Share of the intervals that hold the truth; all of them must exist."""
    held = [e.low <= truth <= e.high for e in estimates if e.low is not None and e.high is not None]
    assert len(held) == TRIALS
    return sum(held) / TRIALS


@pytest.mark.slow
@pytest.mark.parametrize("spread", [0.1, 0.3], ids=["equal spread", "threefold spread"])
def test_welch_covers_what_it_says_at_five_seeds(spread: float) -> None:
    """A 95 % Welch interval over five seeds holds the truth 95 times in 100, within 2."""
    arms, scratches = draw(n_seeds=5, seed=0)
    arms = ARM[0] + (arms - ARM[0]) * spread / ARM[1]
    estimates = [estimate_difference(a, b) for a, b in zip(arms, scratches, strict=True)]
    assert coverage(estimates, ARM[0] - SCRATCH[0]) == pytest.approx(0.95, abs=0.02)


@pytest.mark.slow
def test_percentile_bootstrap_covers_87_percent_at_five_seeds() -> None:
    """Why differences have Welch's interval: the usual bootstrap is too narrow, 87 % for 95 %."""
    arms, scratches = draw(n_seeds=5, seed=1)
    interval = stats.bootstrap(
        (arms, scratches),
        lambda x, y, axis: x.mean(axis=axis) - y.mean(axis=axis),
        n_resamples=1000,
        batch=50,
        axis=-1,
        method="percentile",
        rng=np.random.default_rng(2),
    ).confidence_interval
    truth = ARM[0] - SCRATCH[0]
    held = (interval.low <= truth) & (truth <= interval.high)
    assert held.mean() == pytest.approx(0.87, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("n_seeds", "claimed"), [(5, 0.87), (10, 0.92)])
def test_bca_of_ratios_covers_what_its_note_says(n_seeds: int, claimed: float) -> None:
    """The note next to a ratio of few seeds tells the truth about its interval, within 3."""
    arms, scratches = draw(n_seeds, seed=3)
    rng = np.random.default_rng(4)
    estimates = [
        estimate_ratio(lambda a, b: a / b, a, b, rng=rng, n_resamples=1000)
        for a, b in zip(arms, scratches, strict=True)
    ]
    assert coverage(estimates, ARM[0] / SCRATCH[0]) == pytest.approx(claimed, abs=0.03)
    assert f"{claimed:.0%}".replace("%", " %") in estimate_note(n_seeds)


def estimate_note(n_seeds: int) -> str:
    """The note of a ratio with that many seeds."""
    arms, scratches = draw(n_seeds, seed=5)
    rng = np.random.default_rng(6)
    return estimate_ratio(lambda a, b: a / b, arms[0], scratches[0], rng=rng).note
