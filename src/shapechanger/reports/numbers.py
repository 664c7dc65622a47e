"""Numbers as a reader wants them: no more digits than the interval bears, and no -0."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shapechanger.transfer.metrics import Estimate

__all__ = [
    "CONFIDENCE",
    "UNDEFINED",
    "SeedMean",
    "count",
    "estimate_text",
    "interval_text",
    "list_text",
    "number",
    "share_text",
    "spread_text",
    "t_interval",
]

UNDEFINED: Final = "undefined"

# From here on thousands separators make a number longer than its powers of ten.
_HUGE: Final = 1e10
_MOST_DECIMALS: Final = 6
# Of a number without an interval; an interval bears two digits of its width.
_SIGNIFICANT: Final = 4


def number(value: float, decimals: int | None = None, *, signed: bool = False) -> str:
    """A number with separated thousands, or with a power of ten where it is huge.

    Args:
        value: The number, finite.
        decimals: Digits after the point; None for four digits in all.
        signed: Whether a number above zero bears its sign, as a difference should.
    """
    sign = "+" if signed and value > 0.0 else ""
    if abs(value) >= _HUGE:
        mantissa, exponent = f"{value:.3e}".split("e")
        return f"{sign}{mantissa}e{int(exponent)}"
    if decimals is None:
        decimals = 0 if value == int(value) else _decimals(abs(value), _SIGNIFICANT)
    rounded = round(value, decimals) + 0.0  # -0.0 turns into 0.0.
    return f"{sign if rounded else ''}{rounded:,.{decimals}f}"


def count(value: float) -> str:
    """A number of steps, whole."""
    return number(value, 0)


def interval_text(value: float, low: float, high: float, *, signed: bool = False) -> str:
    """An estimate with its interval, as in `+0.31 [+0.22, +0.40]`."""
    decimals = _decimals(high - low, 2)
    # An end that is not zero must not look as if it were: it decides whether 0 is in the interval.
    while decimals < _MOST_DECIMALS and any(
        end != 0.0 and round(end, decimals) == 0.0 for end in (low, high)
    ):
        decimals += 1
    texts = (number(x, decimals, signed=signed) for x in (value, low, high))
    return "{} [{}, {}]".format(*texts)


def estimate_text(estimate: Estimate, *, signed: bool = False) -> str:
    """An estimate in one line, whether it has a value and an interval or not."""
    if estimate.value is None:
        return UNDEFINED
    if estimate.low is None or estimate.high is None:
        return f"{number(estimate.value, signed=signed)} (no interval)"
    return interval_text(estimate.value, estimate.low, estimate.high, signed=signed)


def list_text(values: Sequence[float]) -> str:
    """Several numbers with the same digits after the point, enough to tell them apart."""
    decimals = _decimals(max(values) - min(values), 3)
    return "; ".join(number(value, decimals) for value in values)


def _decimals(size: float, significant: int) -> int:
    """Digits after the point that show so many significant digits of `size`."""
    if size == 0.0:
        return 0
    return min(max(significant - 1 - math.floor(math.log10(size)), 0), _MOST_DECIMALS)


CONFIDENCE: Final = 0.95


class SeedMean(NamedTuple):
    """Means with their t-intervals.

    Attributes:
        mean: Mean over the seeds, shape (n,).
        low: Lower end, shape (n,).
        high: Upper end, shape (n,).
    """

    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def t_interval(samples: NDArray[np.float64]) -> SeedMean:
    """Student's t-interval of the mean over seeds, mean ± t(0.95, n - 1) · s / sqrt(n).

    Args:
        samples: One row for each seed, shape (n_seeds, n). One seed has no interval: both ends are
            its mean.
    """
    n_seeds = samples.shape[0]
    mean = samples.mean(axis=0)
    if n_seeds == 1:
        return SeedMean(mean, mean, mean)
    error = samples.std(axis=0, ddof=1) / np.sqrt(n_seeds)
    half = float(stats.t.ppf(0.5 + CONFIDENCE / 2.0, n_seeds - 1)) * error
    return SeedMean(mean, mean - half, mean + half)


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
