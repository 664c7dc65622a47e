"""How some numbers are spread: counted in bins of equal width."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

__all__ = ["BINS", "Spread", "spread"]

BINS: Final = 21
"""An odd number, so that 0 has a bin of its own where the range is as wide on both sides."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How some numbers are spread.

    Attributes:
        counts: How many are in each bin, the lowest first.
        low: Where the first bin begins.
        high: Where the last bin ends.
        median: The median.
        least: The smallest number.
        most: The largest number.
        missing: How many were no numbers, and are counted nowhere else.
    """

    counts: tuple[int, ...]
    low: float
    high: float
    median: float
    least: float
    most: float
    missing: int

    @property
    def total(self) -> int:
        """How many numbers there are."""
        return sum(self.counts)


def spread(
    values: Iterable[float], low: float = -math.inf, high: float = math.inf, bins: int = BINS
) -> Spread | None:
    """Count numbers in bins.

    Args:
        values: The numbers; NaN and infinite ones are counted as missing.
        low: Where the first bin begins; that of the smallest number if there is no bound.
        high: Where the last bin ends; as `low`. What is beyond counts in the outer bins.
        bins: How many.

    Returns:
        None if there is no number.
    """
    given = np.fromiter(values, np.float64)
    numbers = given[np.isfinite(given)]
    if not len(numbers):
        return None
    least, most = float(numbers.min()), float(numbers.max())
    begin = low if math.isfinite(low) else least
    end = high if math.isfinite(high) else most
    if not begin < end:  # All are alike.
        begin, end = begin - 0.5, begin + 0.5
    counts = np.histogram(np.clip(numbers, begin, end), bins, (begin, end))[0]
    return Spread(
        tuple(int(count) for count in counts),
        begin,
        end,
        float(np.median(numbers)),
        least,
        most,
        len(given) - len(numbers),
    )
