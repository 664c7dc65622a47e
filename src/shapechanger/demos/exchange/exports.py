"""Export: the steps of a dataset from episodes, for all formats.

Episodes are split where steps do not follow each other, episodes of one dataset are compared, and
images are decoded once for each step that has a new one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Episode, EpisodeHeader, Step
from shapechanger.demos.episodes.records import Keep, longest_period_s
from shapechanger.demos.exchange.format import ExchangeEpisode, ExchangeStep, Format
from shapechanger.demos.jpeg import decode_picture
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

_NS_PER_S: Final = 1e9


def kept_steps(rows: Iterable[ExchangeStep]) -> Iterator[tuple[Step, bytes | None]]:
    """Yield the steps that are not excluded, each with its image, even where it is shared."""
    picture: bytes | None = None
    for row in rows:
        picture = picture if row.jpeg is None else row.jpeg
        if row.dropped is None:
            yield row.step, picture


def exchange_episode(episode: Episode, steps: Sequence[Step]) -> ExchangeEpisode:
    """Return some steps of an episode for export; images are read step by step."""
    return ExchangeEpisode(
        header=episode.header,
        rows=_rows(episode, steps),
        name=episode.path.name,
        outcome=episode.outcome,
    )


def consecutive_parts(
    episodes: Sequence[tuple[Episode, Sequence[Step]]], form: Format
) -> tuple[list[ExchangeEpisode], list[str]]:
    """Split episodes where steps are excluded or missing, and at pauses; return notes, too."""
    parts: list[ExchangeEpisode] = []
    off_s: list[float] = []
    pauses_s: list[float] = []
    whole = missing = 0
    for episode, steps in episodes:
        whole += bool(steps)
        longest_s = longest_period_s(episode.header.control_hz)
        starts = [0] if steps else []
        for number, (one, two) in enumerate(pairwise(steps), 1):
            passed_s = _passed_s(one, two)
            if two.index != one.index + 1:
                missing += 1
            elif passed_s is not None and passed_s > longest_s:
                pauses_s.append(passed_s)
            else:
                continue
            starts.append(number)
        for start, end in pairwise([*starts, len(steps)]):
            part = exchange_episode(episode, steps[start:end])
            header = replace(part.header, created=_started(episode, steps[start]))
            outcome = episode.outcome if end == len(steps) else ""
            parts.append(replace(part, header=header, outcome=outcome))
            by_s = _off_s(steps[start:end], header.control_hz)
            off_s += [by_s] if by_s > 0.5 / header.control_hz else []
    notes: list[str] = []
    if len(parts) > whole:
        where = [f"excluded or missing steps ({missing} times)"] if missing else []
        if pauses_s:
            where.append(f"pauses ({len(pauses_s)}, up to {max(pauses_s):.4g} s)")
        notes.append(
            f"Episodes are split at {' and '.join(where)}, because {form.title} takes each "
            f"step for the successor of the one before: {whole} became {len(parts)}."
        )
    if off_s and not form.timed:
        notes.append(
            f"{form.title} takes the time of a step to be its number divided by the rate, "
            f"which is off by more than half a period in {len(off_s)} of {len(parts)} "
            f"episodes, by up to {max(off_s):.4g} s."
        )
    return parts, notes


def _off_s(steps: Sequence[Step], hz: float) -> float:
    """Return how far times are off those by the rate, s."""
    since_s = [_passed_s(steps[0], step) for step in steps]
    return max(0.0 if at is None else abs(at - n / hz) for n, at in enumerate(since_s))


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


def value_names(layout: Layout) -> list[str]:
    """Return a name for each value of a layout; those of a block are numbered, as in `map[3]`."""
    return [
        feature.name if not feature.shape else f"{feature.name}[{place}]"
        for feature in layout
        for place in range(feature.size)
    ]


def decoded_steps(
    rows: Iterable[ExchangeStep], size: tuple[int, int] | None, name: str, title: str
) -> Iterator[tuple[ExchangeStep, bytes, NDArray[np.uint8] | None]]:
    """Yield steps for a dataset with an image at every step, each with its image.

    Args:
        rows: The steps.
        size: Width and height of all images; None without images.
        name: How to name the episode in errors.
        title: How to name the format in errors.

    Yields:
        The step; its image, also if it is shared; and its pixels if it is new, shape
        (height, width, 3).
    """
    jpeg = b""
    for number, row in enumerate(rows):
        pixels = None
        if size is not None:
            where = f"of step {number} of {name}"
            if row.jpeg is not None:
                jpeg, pixels = row.jpeg, decode_picture(row.jpeg, where)
                if pixels.shape[1::-1] != size:
                    raise DemosError(
                        "The image {} has {} x {} pixels, and not {} x {} like the others: a {} "
                        "dataset has one size.".format(where, *pixels.shape[1::-1], *size, title)
                    )
            if not jpeg:
                raise DemosError(
                    f"There is no image {where}, but {title} needs one at every step: drop the "
                    "steps before the first image, or export to csv."
                )
        yield row, jpeg, pixels


def require_alike(episodes: Sequence[ExchangeEpisode], title: str) -> None:
    """Refuse episodes that do not fit into one dataset."""
    first, *others = episodes
    for episode in others:
        theirs = _kind(episode.header)
        for what, ours in _kind(first.header).items():
            if ours != theirs[what]:
                raise DemosError(
                    f"{first.name} has {what} {ours}, and {episode.name} {theirs[what]}: a {title} "
                    "dataset has one kind of episode, so export each kind to a dataset of its own."
                )


def _kind(header: EpisodeHeader) -> dict[str, str]:
    """Describe what all episodes of a dataset have in common."""
    action, state = (
        ", ".join(map(str, Layout.from_json(layout))) if layout else "none"
        for layout in (header.action_layout, header.state_layout)
    )
    size = "no size" if header.image_size is None else "{} x {}".format(*header.image_size)
    rate = f"{header.control_hz:g}"
    return {
        "the actions": action, "the state": state, "pictures of": size, "steps a second:": rate
    }  # fmt: skip


def _rows(episode: Episode, steps: Sequence[Step]) -> Iterator[ExchangeStep]:
    newest = episode.steps[-1].index if episode.steps else -1
    kept = {step.index for step in episode.kept}
    why = {
        index: drop.why
        for drop in episode.drops
        if not isinstance(drop, Keep)
        for index in range(max(0, drop.first), min(drop.last, newest) + 1)
    }
    marks: dict[int, tuple[str, ...]] = {}
    for mark in episode.marks:
        marks[mark.step] = (*marks.get(mark.step, ()), mark.text)
    frame = ""
    for step in steps:
        yield ExchangeStep(
            step=step,
            jpeg=episode.jpeg(step) if step.frame != frame else None,
            marks=marks.get(step.index, ()),
            dropped=None if step.index in kept else why.get(step.index, ""),
        )
        frame = step.frame
