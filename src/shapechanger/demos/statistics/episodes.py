"""An episode in a few numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from shapechanger.demos.episodes import DRIVERS, Driver, Episode, Step

__all__ = ["EpisodeSummary", "gaps_s", "summary"]

_NS_PER_S: Final = 1e9
_COLLISION: Final = "reward_collision"


@dataclass(frozen=True, slots=True)
class EpisodeSummary:
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


def summary(episode: Episode) -> EpisodeSummary:
    """An episode in a few numbers."""
    header, kept = episode.header, episode.kept
    rewards = [step.reward for step in kept if step.reward is not None]
    return EpisodeSummary(
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
