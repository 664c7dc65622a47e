"""Mean and spread over seeds."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shapechanger.transfer.report.numbers import interval_text, number

__all__ = ["CONFIDENCE", "Spread", "share_text", "spread_text", "t_interval"]

CONFIDENCE: Final = 0.95


class Spread(NamedTuple):
    """Means with their t-intervals.

    Attributes:
        mean: Mean over the seeds, shape (n,).
        low: Lower end, shape (n,).
        high: Upper end, shape (n,).
    """

    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def t_interval(samples: NDArray[np.float64]) -> Spread:
    """Student's t-interval of the mean over seeds, mean ± t(0.95, n - 1) · s / sqrt(n).

    Args:
        samples: One row for each seed, shape (n_seeds, n). One seed has no interval: both ends are
            its mean.
    """
    n_seeds = samples.shape[0]
    mean = samples.mean(axis=0)
    if n_seeds == 1:
        return Spread(mean, mean, mean)
    error = samples.std(axis=0, ddof=1) / np.sqrt(n_seeds)
    half = float(stats.t.ppf(0.5 + CONFIDENCE / 2.0, n_seeds - 1)) * error
    return Spread(mean, mean - half, mean + half)


def spread_text(values: NDArray[np.float64]) -> str:
    """The mean of one number for each seed with its t-interval, as in `950 [900, 1,000]`.

    Args:
        values: Shape (n_seeds,).
    """
    if values.size == 1:
        return f"{number(float(values[0]))} (no interval)"
    mean, low, high = (float(x[0]) for x in t_interval(values[:, np.newaxis]))
    return interval_text(mean, low, high)


def share_text(shares: NDArray[np.float64]) -> str:
    """The mean of one share for each seed with its t-interval, as in `85 % [71 %, 99 %]`.

    The interval is cut off at 0 and 1, where no share can be beyond.

    Args:
        shares: 0 to 1, shape (n_seeds,); empty for an empty text.
    """
    if shares.size == 0:
        return ""
    if shares.size == 1:
        return f"{_percent(float(shares[0]))} (no interval)"
    spread = np.clip(np.concatenate(t_interval(shares[:, np.newaxis])), 0.0, 1.0)
    mean, low, high = (_percent(float(x)) for x in spread)
    return f"{mean} [{low}, {high}]"


def _percent(share: float) -> str:
    return f"{number(100.0 * share, 0)} %"
