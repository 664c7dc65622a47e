"""Rates of recordings: times between steps, and how far they vary."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Final

import numpy as np

from shapechanger.demos.episodes import Episode

_SAME_RATE: Final = 0.01  # Two recorders at 20 Hz may write 20 and 20.000001.
_MOST_JITTER: Final = 0.25  # Two settings of a rate differ by at least a third.
_MIN_PERIODS: Final = 20


def gaps_s(episode: Episode) -> list[float]:
    """Return the times between consecutive kept steps on the robot's clock, s.

    Steps without a time, and pairs with dropped steps in between, are left out.
    """
    return [
        (two.clock_ns - one.clock_ns) / 1e9
        for one, two in pairwise(episode.kept)
        if two.index == one.index + 1 and one.clock_ns is not None and two.clock_ns is not None
    ]


def rate_jitter(periods_s: Iterable[float], control_hz: float) -> float:
    """Return how far the rate of a recording of so many steps per second varied, as a share of it.

    It is the larger deviation of the 5th and the 95th percentile of the times between steps, s; at
    most 0.25, and 0 for fewer than 20 times.
    """
    periods = np.fromiter(periods_s, np.float64)
    if len(periods) < _MIN_PERIODS:
        return 0.0
    low, high = np.percentile(periods, (5.0, 95.0)) * control_hz
    return float(min(max(1.0 - low, high - 1.0, 0.0), _MOST_JITTER))


def is_same_rate(recorded_hz: float, control_hz: float, jitter: float = 0.0) -> bool:
    """Return whether a robot has the rate of a recording, within 1 % or its `rate_jitter`."""
    allowed = max(_SAME_RATE, min(jitter, _MOST_JITTER))
    return abs(recorded_hz / control_hz - 1.0) <= allowed
