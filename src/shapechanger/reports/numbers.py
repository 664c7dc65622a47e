"""Formatting of numbers, with a number of digits that suits their interval, and without -0."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

_Name = TypeVar("_Name", bound=str)

UNDEFINED: Final = "undefined"
CONFIDENCE: Final = 0.95

# Size from which numbers are shorter in scientific notation than with thousands separators.
_HUGE: Final = 1e10
_MAX_DECIMALS: Final = 6
# Significant digits of a number without an interval; an interval gets two digits of its width.
_SIGNIFICANT: Final = 4


def number(value: float, decimals: int | None = None, *, signed: bool = False) -> str:
    """Format a number with thousands separators, or in scientific notation from 1e10."""
    sign = "+" if signed and value > 0.0 else ""
    if abs(value) >= _HUGE:
        mantissa, exponent = f"{value:.3e}".split("e")
        return f"{sign}{mantissa}e{int(exponent)}"
    if decimals is None:
        decimals = 0 if value == int(value) else _decimals(abs(value), _SIGNIFICANT)
    rounded = round(value, decimals) + 0.0  # -0.0 turns into 0.0.
    return f"{sign if rounded else ''}{rounded:,.{decimals}f}"


def count(value: float) -> str:
    """Format a number of steps."""
    return number(value, 0)


def interval_text(
    value: float | None, low: float | None, high: float | None, *, signed: bool = False
) -> str:
    """Format an estimate, None if undefined, with its interval, like `+0.31 [+0.22, +0.40]`."""
    if value is None:
        return UNDEFINED
    if low is None or high is None:
        return f"{number(value, signed=signed)} (no interval)"
    decimals = _decimals(high - low, 2)
    # An end other than zero must not be rounded to zero, or the interval would seem to contain 0.
    while decimals < _MAX_DECIMALS and any(
        end != 0.0 and round(end, decimals) == 0.0 for end in (low, high)
    ):
        decimals += 1
    texts = (number(x, decimals, signed=signed) for x in (value, low, high))
    return "{} [{}, {}]".format(*texts)


def list_text(values: Sequence[float]) -> str:
    """Format several numbers with the same decimals, which show three digits of their range."""
    decimals = _decimals(max(values) - min(values), 3)
    return "; ".join(number(value, decimals) for value in values)


def duration_text(seconds: float) -> str:
    """Format a duration.

    >>> duration_text(4.25), duration_text(59.97), duration_text(754.0)
    ('4.2 s', '1:00 min', '12:34 min')
    """
    if round(seconds, 1) < 60.0:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d} min"


def shares_text(counts: Mapping[_Name, int]) -> str:
    """Format each name's share of the total.

    >>> shares_text({"policy": 30, "expert": 10}), shares_text({"expert": 4})
    ('policy 75 %, expert 25 %', 'expert')
    """
    total = sum(counts.values())
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{name} {100.0 * count / total:.0f} %" for name, count in counts.items())


class SeedMean(NamedTuple):
    """Means over seeds with the ends of their t-intervals, each of shape (n,)."""

    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def t_interval(samples: NDArray[np.float64]) -> SeedMean:
    """Student's t-interval of the mean over seeds, mean ± t(0.95, n - 1) · s / sqrt(n).

    The samples have the shape (n_seeds, n). One seed has no interval: both ends are its mean.
    """
    from scipy import stats  # Slow to import, and not needed to format numbers.

    n_seeds = samples.shape[0]
    mean = samples.mean(axis=0)
    if n_seeds == 1:
        return SeedMean(mean, mean, mean)
    error = samples.std(axis=0, ddof=1) / np.sqrt(n_seeds)
    half = float(stats.t.ppf(0.5 + CONFIDENCE / 2.0, n_seeds - 1)) * error
    return SeedMean(mean, mean - half, mean + half)


def spread_text(values: NDArray[np.float64]) -> str:
    """Format the mean of values, (n_seeds,), with its t-interval, such as `950 [900, 1,000]`."""
    if values.size == 1:
        return interval_text(float(values[0]), None, None)
    mean, low, high = (float(x[0]) for x in t_interval(values[:, np.newaxis]))
    return interval_text(mean, low, high)


def share_text(shares: NDArray[np.float64]) -> str:
    """Format the mean of shares, (n_seeds,), each from 0 to 1, such as `85 % [71 %, 99 %]`.

    The t-interval over seeds is clipped to 0 and 1. Without shares, the text is empty.
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


def _decimals(size: float, significant: int) -> int:
    """Return the decimals that show `significant` significant digits of `size`."""
    if size == 0.0:
        return 0
    return min(max(significant - 1 - math.floor(math.log10(size)), 0), _MAX_DECIMALS)
