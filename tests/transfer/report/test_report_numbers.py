"""Formatting of numbers and intervals."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.reports.numbers import interval_text, list_text, number, spread_text, t_interval
from shapechanger.transfer.metrics.intervals import Estimate, undefined
from shapechanger.transfer.report.verdict import estimate_text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        # Decimals end at four significant digits, or six decimals; huge numbers have exponents.
        (number(0.0), "0"),
        (number(-0.0), "0"),
        (number(3.0), "3"),
        (number(0.12345), "0.1235"),
        (number(-880.61), "-880.6"),
        (number(1234567.0), "1,234,567"),
        (number(-1.5e12), "-1.500e12"),
        (number(1e-9), "0.000000"),
        # The rounded number decides about the sign.
        (number(0.25, 2, signed=True), "+0.25"),
        (number(0.001, 2, signed=True), "0.00"),
        (number(-0.001, 2, signed=True), "0.00"),
        (number(2e11, signed=True), "+2.000e11"),
        # The width of an interval decides about decimals; up to six keep its ends other than 0.
        (interval_text(0.31, 0.22, 0.40), "0.31 [0.22, 0.40]"),
        (interval_text(0.01, -0.1234, 0.1434), "0.01 [-0.12, 0.14]"),
        (interval_text(880.6, 859.1, 902.2), "881 [859, 902]"),
        (interval_text(0.5, 0.004, 1.0), "0.500 [0.004, 1.000]"),
        (interval_text(0.5, 1e-9, 1.0), "0.500000 [0.000000, 1.000000]"),
        (interval_text(5.0, 5.0, 5.0), "5 [5, 5]"),
        (interval_text(1e12, -2e12, 4e12), "1.000e12 [-2.000e12, 4.000e12]"),
        (estimate_text(undefined("Why not.")), "undefined"),
        (estimate_text(Estimate(0.5), signed=True), "+0.5000 (no interval)"),
        (estimate_text(Estimate(0.3, 0.2, 0.4), signed=True), "+0.30 [+0.20, +0.40]"),
        # Numbers of a list share their digits.
        (list_text([5.0, 7.5, 15.0]), "5.0; 7.5; 15.0"),
        (list_text([1000.0, 1000.0]), "1,000; 1,000"),
        (spread_text(np.array([950.0])), "950 (no interval)"),
    ],
)
def test_numbers_by_hand(text: str, words: str) -> None:
    assert text == words


def test_t_interval_by_hand() -> None:
    """Seeds 1, 2, 3: mean 2, s = 1, t(0.975, 2) = 4.3027, half width 4.3027 / sqrt(3)."""
    spread = t_interval(np.array([[1.0, 5.0], [2.0, 5.0], [3.0, 5.0]]))
    np.testing.assert_allclose(spread.mean, [2.0, 5.0])
    np.testing.assert_allclose(spread.high - spread.mean, [2.48414, 0.0], atol=1e-5)
    np.testing.assert_allclose(spread.mean - spread.low, [2.48414, 0.0], atol=1e-5)
    assert spread_text(np.array([1.0, 2.0, 3.0])) == "2.0 [-0.5, 4.5]"
    # One run has no interval.
    spread = t_interval(np.array([[1.0, 2.0]]))
    np.testing.assert_array_equal(spread.low, [1.0, 2.0])
    np.testing.assert_array_equal(spread.high, [1.0, 2.0])
