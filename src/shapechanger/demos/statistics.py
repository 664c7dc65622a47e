"""What is in a recording, in numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from shapechanger.demos.episodes import DRIVERS, Driver, Episode, Step

__all__ = ["BINS", "Distribution", "EpisodeStatistics", "gaps_s", "spread", "summary"]

_NS_PER_S: Final = 1e9
_COLLISION: Final = "reward_collision"


@dataclass(frozen=True, slots=True)
class EpisodeStatistics:
    """What there is to say of an episode.

    Attributes:
        name: Name of its folder.
        what: Its env or robot.
        created: When it began, ISO 8601 in UTC.
        steps: How many steps there are.
        kept: How many of them count.
        seconds: How long those last, s.
        drivers: How many of those each driver decided.
        marks: How many marks were set.
        reward: Sum of the rewards of those that have one; None if none has.
        collisions: Steps of those that were punished for a collision.
        stopped: Steps of those at which the robot did not do what it was told.
        outcome: How it ended.
        closed: Whether it was ended, and not cut off.
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
    """An episode in a few numbers."""
    header, kept = episode.header, episode.kept
    rewards = [step.reward for step in kept if step.reward is not None]
    return EpisodeStatistics(
        name=episode.path.name,
        what=header.env.split("/")[-1] or header.robot or header.body or header.source,
        created=header.created,
        steps=len(episode.steps),
        kept=len(kept),
        seconds=episode.seconds,
        drivers=_drivers(kept),
        marks=len(episode.marks),
        reward=sum(rewards) if rewards else None,
        collisions=sum(step.terms.get(_COLLISION, 0.0) < 0.0 for step in kept),
        stopped=sum(bool(step.stop_reason) for step in kept),
        outcome=episode.outcome,
        closed=episode.closed,
    )


def _drivers(steps: Sequence[Step]) -> dict[Driver, int]:
    """Who decided how many steps, whoever decided most first."""
    counts = {driver: sum(step.driver == driver for step in steps) for driver in DRIVERS}
    most = sorted(DRIVERS, key=lambda driver: -counts[driver])
    return {driver: counts[driver] for driver in most if counts[driver]}


def gaps_s(episode: Episode) -> list[float]:
    """Times from one step that counts to the next on the robot's clock, s.

    Left out are steps that do not say when they were, and those with others between them that do
    not count.
    """
    return [
        (at - before) / _NS_PER_S
        for one, two in pairwise(episode.kept)
        if two.index == one.index + 1
        and (before := _at_ns(one)) is not None
        and (at := _at_ns(two)) is not None
    ]


def _at_ns(step: Step) -> int | None:
    """When a step was."""
    return step.captured_ns if step.captured_ns is not None else step.decided_ns


BINS: Final = 21
"""An odd number, so that 0 has a bin of its own where the range is as wide on both sides."""


@dataclass(frozen=True, slots=True)
class Distribution:
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
) -> Distribution | None:
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
    return Distribution(
        tuple(int(count) for count in counts),
        begin,
        end,
        float(np.median(numbers)),
        least,
        most,
        len(given) - len(numbers),
    )
