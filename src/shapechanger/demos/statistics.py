"""Summaries of episodes, and distributions of their values."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from shapechanger.demos.episodes import DRIVERS, Driver, Episode

_NS_PER_S: Final = 1e9
_COLLISION: Final = "reward_collision"


@dataclass(frozen=True, slots=True)
class EpisodeStatistics:
    """Summary of an episode. "Kept" steps are those that were not dropped.

    Attributes:
        name: Name of its folder.
        what: Its env or robot.
        created: Start time, ISO 8601 in UTC.
        steps: Number of all steps.
        kept: Number of kept steps.
        seconds: Duration of the kept steps, s.
        drivers: Number of kept steps by driver, most frequent first.
        marks: Number of marks.
        reward: Sum of the rewards of the kept steps; None if none has a reward.
        collisions: Kept steps with a collision penalty.
        stopped: Kept steps at which the robot overrode the action.
        outcome: How the episode ended.
        closed: Whether the episode was closed properly.
    """

    name: str
    what: str
    created: str
    steps: int
    kept: int
    seconds: float
    drivers: dict[Driver, int]
    marks: int
    reward: float | None
    collisions: int
    stopped: int
    outcome: str
    closed: bool


def summary(episode: Episode) -> EpisodeStatistics:
    """Summarise an episode."""
    header, kept = episode.header, episode.kept
    rewards = [step.reward for step in kept if step.reward is not None]
    counts = Counter(step.driver for step in kept)
    return EpisodeStatistics(
        name=episode.path.name,
        what=header.env.split("/")[-1] or header.robot or header.body or header.source,
        created=header.created,
        steps=len(episode.steps),
        kept=len(kept),
        seconds=episode.seconds,
        drivers={d: counts[d] for d in sorted(DRIVERS, key=lambda d: -counts[d]) if counts[d]},
        marks=len(episode.marks),
        reward=sum(rewards) if rewards else None,
        collisions=sum(step.terms.get(_COLLISION, 0.0) < 0.0 for step in kept),
        stopped=sum(bool(step.stop_reason) for step in kept),
        outcome=episode.outcome,
        closed=episode.closed,
    )


def gaps_s(episode: Episode) -> list[float]:
    """Return the times between consecutive kept steps on the robot's clock, s.

    Steps without a time, and pairs with dropped steps in between, are left out.
    """
    return [
        (at - before) / _NS_PER_S
        for one, two in pairwise(episode.kept)
        if two.index == one.index + 1
        and (before := one.clock_ns) is not None
        and (at := two.clock_ns) is not None
    ]


_SAME_RATE: Final = 0.01  # Two recorders at 20 Hz may write 20 and 20.000001.
_MOST_JITTER: Final = 0.25  # Two settings of a rate differ by at least a third.
_MIN_PERIODS: Final = 20
_MIDDLE: Final = (5.0, 95.0)  # %


def rate_jitter(periods_s: Iterable[float], control_hz: float) -> float:
    """Return how far the rate of a recording varied, as a share of the rate.

    Args:
        periods_s: Times between consecutive steps, s.
        control_hz: Steps per second, as recorded.

    Returns:
        The larger deviation of the 5th and the 95th percentile of the periods; at most 0.25, and 0
        for fewer than 20 periods.
    """
    periods = np.fromiter(periods_s, np.float64)
    if len(periods) < _MIN_PERIODS:
        return 0.0
    low, high = np.percentile(periods, _MIDDLE) * control_hz
    return float(min(max(1.0 - low, high - 1.0, 0.0), _MOST_JITTER))


def is_same_rate(recorded_hz: float, control_hz: float, jitter: float = 0.0) -> bool:
    """Return whether a robot has the rate of a recording, within 1 % or the recording's jitter.

    Args:
        recorded_hz: Steps per second of the recording.
        control_hz: Steps per second of the robot, or of another recording.
        jitter: Result of `rate_jitter`.
    """
    allowed = max(_SAME_RATE, min(jitter, _MOST_JITTER))
    return abs(recorded_hz / control_hz - 1.0) <= allowed


_BINS: Final = 21
"""Number of bins. It is odd, so that 0 has a bin of its own in a symmetric range."""


@dataclass(frozen=True, slots=True)
class Distribution:
    """Histogram and order statistics of a set of values.

    Attributes:
        counts: Number of values in each bin, lowest first.
        low: Lower edge of the first bin.
        high: Upper edge of the last bin.
        median: The median.
        least: The smallest value.
        most: The largest value.
        missing: Number of NaN and infinite values, which are counted nowhere else.
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
        """Number of finite values."""
        return sum(self.counts)


def spread(
    values: Iterable[float], low: float = -math.inf, high: float = math.inf, bins: int = _BINS
) -> Distribution | None:
    """Return the distribution of values.

    Args:
        values: The values; NaN and infinities are counted as missing.
        low: Lower edge of the first bin; the smallest value if infinite.
        high: Upper edge of the last bin; the largest value if infinite. Values outside the range
            are counted in the outer bins.
        bins: Number of bins.

    Returns:
        None if there is no finite value.
    """
    given = np.fromiter(values, np.float64)
    numbers = given[np.isfinite(given)]
    if not len(numbers):
        return None
    least, most = float(numbers.min()), float(numbers.max())
    begin = low if math.isfinite(low) else least
    end = high if math.isfinite(high) else most
    if not begin < end:  # All values are equal.
        begin, end = begin - 0.5, begin + 0.5
    counts = np.histogram(np.clip(numbers, begin, end), bins, (begin, end))[0]
    return Distribution(
        tuple(int(count) for count in counts),
        begin,
        end,
        float(np.median(numbers)),
        least,
        most,
        len(given) - len(numbers),
    )
