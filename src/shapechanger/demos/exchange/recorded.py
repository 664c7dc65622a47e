"""The form between all formats: an episode whose steps come one by one, with their pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from shapechanger.demos.episodes import Episode, EpisodeHeader, Step

__all__ = ["Recorded", "Row", "recorded_of", "seen"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
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
    rows: Iterable[Row]
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


def seen(rows: Iterable[Row]) -> Iterator[tuple[Step, bytes | None]]:
    """The steps that count, each with the picture that it saw, also where it shares one."""
    picture: bytes | None = None
    for row in rows:
        picture = picture if row.jpeg is None else row.jpeg
        if row.dropped is None:
            yield row.step, picture


def _rows(episode: Episode, *, dropped: bool) -> Iterator[Row]:
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
        yield Row(
            step=step,
            jpeg=jpeg,
            marks=marks.get(step.index, ()),
            dropped=why.get(step.index, "") if gone else None,
        )


def _newest(episode: Episode) -> int:
    """Index of the newest step; -1 if there is none."""
    return episode.steps[-1].index if episode.steps else -1
