"""The form between all formats: an episode whose steps come one by one, with their pictures."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from shapechanger.demos.episodes import Episode, EpisodeHeader, Step
from shapechanger.errors import DemosError

__all__ = [
    "GAP_PERIODS",
    "HZ_UNKNOWN",
    "ExchangeStep",
    "Recorded",
    "one_rate",
    "rate_hz",
    "recorded_of",
    "require_order",
    "seen",
    "split_at_gaps",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeStep:
    """One step on its way from one format to another.

    Attributes:
        step: The step; its index and the name of its frame do not count here.
        jpeg: Its picture; None for that of the row before, or without a camera.
        marks: The words of each mark on it.
        dropped: Why the step does not count; None if it does.
    """

    step: Step
    jpeg: bytes | None
    marks: tuple[str, ...] = ()
    dropped: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """One episode on its way from one format to another.

    Attributes:
        header: What it is of.
        rows: Its steps in order; they can be read once, at any time.
        name: What to call it when something is wrong with it.
        outcome: How it ended; "" for just so.
    """

    header: EpisodeHeader
    rows: Iterable[ExchangeStep]
    name: str
    outcome: str = ""


def recorded_of(episode: Episode, *, dropped: bool = False) -> Recorded:
    """An episode of ours on its way out; its pictures are read row by row.

    Args:
        episode: The episode.
        dropped: Whether the steps that do not count go with it.
    """
    return Recorded(
        header=episode.header,
        rows=_rows(episode, dropped=dropped),
        name=episode.path.name,
        outcome=episode.outcome,
    )


def seen(rows: Iterable[ExchangeStep]) -> Iterator[tuple[Step, bytes | None]]:
    """The steps that count, each with the picture that it saw, also where it shares one."""
    picture: bytes | None = None
    for row in rows:
        picture = picture if row.jpeg is None else row.jpeg
        if row.dropped is None:
            yield row.step, picture


def _rows(episode: Episode, *, dropped: bool) -> Iterator[ExchangeStep]:
    counts = {step.index for step in episode.kept}
    why = {
        index: drop.why
        for drop in episode.drops
        if not drop.keep
        for index in range(max(0, drop.first), min(drop.last, _newest(episode)) + 1)
    }
    marks: dict[int, tuple[str, ...]] = {}
    for mark in episode.marks:
        marks[mark.step] = (*marks.get(mark.step, ()), mark.text)
    shown = ""
    for step in episode.steps:
        gone = step.index not in counts
        if gone and not dropped:
            continue
        jpeg = episode.jpeg(step) if step.frame != shown else None
        shown = step.frame
        yield ExchangeStep(
            step=step,
            jpeg=jpeg,
            marks=marks.get(step.index, ()),
            dropped=why.get(step.index, "") if gone else None,
        )


def _newest(episode: Episode) -> int:
    """Index of the newest step; -1 if there is none."""
    return episode.steps[-1].index if episode.steps else -1


GAP_PERIODS: Final = 30.0
"""A pause of more than this many periods ends an episode."""

HZ_UNKNOWN: Final = 20.0
"""Steps a second of an episode whose data do not say, Hz."""

_NS_PER_S: Final = 1e9

# Measured rates of one setting differ a little; those of two settings differ by a third and more.
_SAME_RATE: Final = 1.3


def require_order(times_ns: Sequence[int], names: Sequence[str], how_to_go_on: str) -> None:
    """Refuse time that runs backwards; two steps at one time are in order.

    Args:
        times_ns: One time a step, ns.
        names: What to call each step.
        how_to_go_on: What the user can do, as the end of a sentence.

    Raises:
        DemosError: If a step is earlier than the one before it.
    """
    for number, (earlier, later) in enumerate(pairwise(times_ns)):
        if later < earlier:
            raise DemosError(
                f"Time runs backwards by {(earlier - later) / _NS_PER_S:.6g} s from "
                f"{names[number]} to {names[number + 1]}: {how_to_go_on}."
            )


def rate_hz(times_ns: Sequence[int]) -> float:
    """Steps a second, from the median of the periods, Hz; `HZ_UNKNOWN` where they say nothing."""
    periods = [later - earlier for earlier, later in pairwise(times_ns)]
    period = statistics.median(periods) if periods else 0.0
    return _NS_PER_S / period if period > 0.0 else HZ_UNKNOWN


def split_at_gaps(times_ns: Sequence[int]) -> list[slice]:
    """The episodes of a drive: a pause of more than `GAP_PERIODS` median periods ends one."""
    if not times_ns:
        return []
    longest = GAP_PERIODS * _NS_PER_S / rate_hz(times_ns)
    starts = [0] + [
        number + 1
        for number, (earlier, later) in enumerate(pairwise(times_ns))
        if later - earlier > longest
    ]
    return [slice(first, last) for first, last in pairwise([*starts, len(times_ns)])]


def one_rate(rates_hz: Sequence[float], names: Sequence[str], how_to_go_on: str) -> None:
    """Refuse episodes whose rates differ by more than measuring them explains.

    Args:
        rates_hz: One rate an episode, Hz.
        names: What to call each episode.
        how_to_go_on: What the user can do, as the end of a sentence.

    Raises:
        DemosError: If one is more than 1.3 times another.
    """
    if not rates_hz:
        return
    slow, fast = min(rates_hz), max(rates_hz)
    if fast > _SAME_RATE * slow:
        raise DemosError(
            f"{names[rates_hz.index(slow)]} has {slow:.3g} steps a second and "
            f"{names[rates_hz.index(fast)]} {fast:.3g}, and one data set has one rate: "
            f"{how_to_go_on}."
        )
