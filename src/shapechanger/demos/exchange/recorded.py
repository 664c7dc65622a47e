"""Common representation of all formats: an episode whose steps are read one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from shapechanger.demos.episodes import Episode, EpisodeHeader, Step
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

DEFAULT_HZ: Final = 20.0
"""Steps per second of an episode without any information on its rate, Hz."""


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


def exchange_episode(episode: Episode, *, dropped: bool = False) -> ExchangeEpisode:
    """Return an episode for export; its pictures are read step by step.

    Args:
        episode: The episode.
        dropped: Whether to include excluded steps.
    """
    return ExchangeEpisode(
        header=episode.header,
        rows=_rows(episode, dropped=dropped),
        name=episode.path.name,
        outcome=episode.outcome,
    )


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


def _rows(episode: Episode, *, dropped: bool) -> Iterator[ExchangeStep]:
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
        if excluded and not dropped:
            continue
        jpeg = episode.jpeg(step) if step.frame != frame else None
        frame = step.frame
        yield ExchangeStep(
            step=step,
            jpeg=jpeg,
            marks=marks.get(step.index, ()),
            dropped=why.get(step.index, "") if excluded else None,
        )
