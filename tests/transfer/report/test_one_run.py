"""Arms with one run, such as zero-shot with a given policy."""

from __future__ import annotations

import numpy as np

from shapechanger.reports.numbers import spread_text, t_interval


def test_one_run_has_a_mean_and_no_interval() -> None:
    assert spread_text(np.array([950.0])) == "950 (no interval)"
    spread = t_interval(np.array([[1.0, 2.0]]))
    np.testing.assert_array_equal(spread.low, [1.0, 2.0])
    np.testing.assert_array_equal(spread.high, [1.0, 2.0])
