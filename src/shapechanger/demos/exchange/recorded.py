"""Common representation of all formats: an episode whose steps are read one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Final

from shapechanger.demos.episodes import Episode, EpisodeHeader, Step
from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

DEFAULT_HZ: Final = 20.0
"""Steps per second of an episode without any information on its rate, Hz."""

_NS_PER_S: Final = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeStep:
    """One step between two formats.

    Attributes:
        step: The step; its index and the name of its frame are ignored.
        jpeg: Its picture; None for that of the step before, or without a camera.
        marks: Texts of its marks.
        dropped: Why the step is excluded; None if it is not.
    """

    step: Step
    jpeg: bytes | None
    marks: tuple[str, ...] = ()
    dropped: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExchangeEpisode:
    """One episode between two formats.

    Attributes:
        header: Its metadata.
        rows: Its steps in order; they can be iterated once, at any time.
        name: How to name the episode in errors.
        outcome: How it ended; "" if unspecified.
    """

    header: EpisodeHeader
    rows: Iterable[ExchangeStep]
    name: str
    outcome: str = ""


def exchange_episode(
    episode: Episode, *, dropped: bool = False, part: range | None = None
) -> ExchangeEpisode:
    """Return an episode for export; its pictures are read step by step.

    Args:
        episode: The episode.
        dropped: Whether to include excluded steps.
        part: Indices of the steps to include; None for all.
    """
    return ExchangeEpisode(
        header=episode.header,
        rows=_rows(episode, dropped=dropped, part=part),
        name=episode.path.name,
        outcome=episode.outcome,
    )


class ConsecutiveParts:
    """Split episodes for formats that take each step for the successor of the one before.

    An episode is split where steps are excluded or missing, and at pauses.

    Args:
        format: How to name the format.
    """

    def __init__(self, format: str) -> None:
        self._format = format
        self._episodes = self._parts = self._missing = 0
        self._pauses_s: list[float] = []
        self._off_s: list[float] = []

    def of(self, episode: Episode, *, dropped: bool = False) -> list[ExchangeEpisode]:
        """Return the parts of an episode; the arguments are those of `exchange_episode`."""
        steps = episode.steps if dropped else episode.kept
        if not steps:
            return []
        longest_s = longest_period_s(episode.header.control_hz)
        starts = [0]
        for number, (one, two) in enumerate(pairwise(steps), 1):
            passed_s = _passed_s(one, two)
            if two.index != one.index + 1:
                self._missing += 1
            elif passed_s is not None and passed_s > longest_s:
                self._pauses_s.append(passed_s)
            else:
                continue
            starts.append(number)
        self._episodes += 1
        self._parts += len(starts)
        parts: list[ExchangeEpisode] = []
        for start, end in pairwise([*starts, len(steps)]):
            indexes = range(steps[start].index, steps[end - 1].index + 1)
            part = exchange_episode(episode, dropped=dropped, part=indexes)
            header = replace(part.header, created=_started(episode, steps[start]))
            outcome = part.outcome if end == len(steps) else ""
            parts.append(replace(part, header=header, outcome=outcome))
            self._measure(steps[start:end], episode.header)
        return parts

    def notes(self, *, timed: bool) -> list[str]:
        """Return what differs from the recording, as sentences.

        Args:
            timed: Whether the format keeps the times of steps.
        """
        found: list[str] = []
        if self._parts > self._episodes:
            where: list[str] = []
            if self._missing:
                where.append(f"excluded or missing steps ({self._missing} times)")
            if self._pauses_s:
                where.append(f"pauses ({len(self._pauses_s)}, up to {max(self._pauses_s):.4g} s)")
            found.append(
                f"Episodes are split at {' and '.join(where)}, because {self._format} takes each "
                f"step for the successor of the one before: {self._episodes} became {self._parts}."
            )
        if self._off_s and not timed:
            found.append(
                f"{self._format} takes the time of a step to be its number divided by the rate, "
                f"which is off by more than half a period in {len(self._off_s)} of {self._parts} "
                f"episodes, by up to {max(self._off_s):.4g} s."
            )
        return found

    def _measure(self, steps: Sequence[Step], header: EpisodeHeader) -> None:
        """Note by how much the times of consecutive steps differ from those by the rate."""
        since_s = [_passed_s(steps[0], step) for step in steps]
        off_s = max(
            abs(at_s - number / header.control_hz) if at_s is not None else 0.0
            for number, at_s in enumerate(since_s)
        )
        if off_s > 0.5 / header.control_hz:
            self._off_s.append(off_s)


def _passed_s(one: Step, two: Step) -> float | None:
    """Return the time between two steps on the robot's clock, s; None if it is unknown."""
    for now, later in ((one.decided_ns, two.decided_ns), (one.captured_ns, two.captured_ns)):
        if now is not None and later is not None:
            return (later - now) / _NS_PER_S
    return None


def _started(episode: Episode, first: Step) -> str:
    """Return when a part of an episode began, ISO 8601; that of the episode if unknown."""
    since_s = _passed_s(episode.steps[0], first) or 0.0
    try:
        began = datetime.fromisoformat(episode.header.created) + timedelta(seconds=since_s)
    except (ValueError, OverflowError):
        return episode.header.created
    return began.isoformat(timespec="milliseconds")


def kept_steps(rows: Iterable[ExchangeStep]) -> Iterator[tuple[Step, bytes | None]]:
    """Yield the steps that are not excluded, each with its picture, even where it is shared."""
    picture: bytes | None = None
    for row in rows:
        picture = picture if row.jpeg is None else row.jpeg
        if row.dropped is None:
            yield row.step, picture


def value_names(layout: Layout) -> list[str]:
    """Return a name for each value of a layout; those of a block are numbered, as in `map[3]`."""
    return [
        feature.name if not feature.shape else f"{feature.name}[{place}]"
        for feature in layout
        for place in range(feature.size)
    ]


def require_alike(episodes: Sequence[ExchangeEpisode], dataset: str) -> None:
    """Refuse episodes that do not fit into one dataset.

    Args:
        episodes: The episodes.
        dataset: How to name the dataset in errors, such as "a Minari dataset".

    Raises:
        DemosError: If their actions, states, picture sizes or rates differ.
    """
    first = episodes[0]
    for episode in episodes[1:]:
        for what, described in _DESCRIPTIONS.items():
            ours, theirs = described(first.header), described(episode.header)
            if ours != theirs:
                raise DemosError(
                    f"{first.name} has {what} {ours}, and {episode.name} {theirs}: {dataset} "
                    "has one kind of episode, so export each kind to a dataset of its own."
                )


def _described_layout(layout: str) -> str:
    return ", ".join(map(str, Layout.from_json(layout))) if layout else "none"


_DESCRIPTIONS: Final[dict[str, Callable[[EpisodeHeader], str]]] = {
    "the actions": lambda header: _described_layout(header.action_layout),
    "the state": lambda header: _described_layout(header.state_layout),
    "pictures of": lambda header: (
        "no size" if header.image_size is None else "{} x {}".format(*header.image_size)
    ),
    "steps a second:": lambda header: f"{header.control_hz:g}",
}


def _rows(episode: Episode, *, dropped: bool, part: range | None) -> Iterator[ExchangeStep]:
    newest = episode.steps[-1].index if episode.steps else -1
    kept = {step.index for step in episode.kept}
    why = {
        index: drop.why
        for drop in episode.drops
        if not drop.keep
        for index in range(max(0, drop.first), min(drop.last, newest) + 1)
    }
    marks: dict[int, tuple[str, ...]] = {}
    for mark in episode.marks:
        marks[mark.step] = (*marks.get(mark.step, ()), mark.text)
    frame = ""
    for step in episode.steps:
        excluded = step.index not in kept
        if (excluded and not dropped) or (part is not None and step.index not in part):
            continue
        jpeg = episode.jpeg(step) if step.frame != frame else None
        frame = step.frame
        yield ExchangeStep(
            step=step,
            jpeg=jpeg,
            marks=marks.get(step.index, ()),
            dropped=why.get(step.index, "") if excluded else None,
        )
