"""Episodes of a recording for export: one by one, split where steps do not follow each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Final

from shapechanger.demos.episodes import Episode, EpisodeHeader, Step
from shapechanger.demos.episodes.records import longest_period_s
from shapechanger.demos.exchange.format import ExchangeEpisode, ExchangeStep, Format
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

_NS_PER_S: Final = 1e9


def exchange_episode(
    episode: Episode, *, dropped: bool = False, part: range | None = None
) -> ExchangeEpisode:
    """Return an episode for export; its pictures are read step by step."""
    rows = _rows(episode, dropped=dropped, part=part)
    return ExchangeEpisode(
        header=episode.header, rows=rows, name=episode.path.name, outcome=episode.outcome
    )


def consecutive_parts(
    episodes: Sequence[Episode], form: Format, *, dropped: bool = False
) -> tuple[list[ExchangeEpisode], list[str]]:
    """Split episodes where steps are excluded or missing, and at pauses."""
    parts: list[ExchangeEpisode] = []
    off_s: list[float] = []
    pauses_s: list[float] = []
    whole = missing = 0
    for episode in episodes:
        steps = episode.steps if dropped else episode.kept
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
            indexes = range(steps[start].index, steps[end - 1].index + 1)
            part = exchange_episode(episode, dropped=dropped, part=indexes)
            header = replace(part.header, created=_started(episode, steps[start]))
            outcome = part.outcome if end == len(steps) else ""
            parts.append(replace(part, header=header, outcome=outcome))
            off_s.append(_off_s(steps[start:end], episode.header))
    notes: list[str] = []
    if len(parts) > whole:
        where = [f"excluded or missing steps ({missing} times)"] if missing else []
        if pauses_s:
            where.append(f"pauses ({len(pauses_s)}, up to {max(pauses_s):.4g} s)")
        notes.append(
            f"Episodes are split at {' and '.join(where)}, because {form.title} takes each "
            f"step for the successor of the one before: {whole} became {len(parts)}."
        )
    if (late_s := [by_s for by_s in off_s if by_s > 0.0]) and not form.timed:
        notes.append(
            f"{form.title} takes the time of a step to be its number divided by the rate, "
            f"which is off by more than half a period in {len(late_s)} of {len(parts)} "
            f"episodes, by up to {max(late_s):.4g} s."
        )
    return parts, notes


def _off_s(steps: Sequence[Step], header: EpisodeHeader) -> float:
    """Return how far times are off those by the rate, s; 0 for less than half a period."""
    since_s = [_passed_s(steps[0], step) for step in steps]
    off_s = max(
        abs(at_s - number / header.control_hz) if at_s is not None else 0.0
        for number, at_s in enumerate(since_s)
    )
    return off_s if off_s > 0.5 / header.control_hz else 0.0


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


def require_alike(episodes: Sequence[ExchangeEpisode], dataset: str) -> None:
    """Refuse episodes that do not fit into one dataset."""
    first, *others = episodes
    for episode in others:
        theirs = _kind(episode.header)
        for what, ours in _kind(first.header).items():
            if ours != theirs[what]:
                raise DemosError(
                    f"{first.name} has {what} {ours}, and {episode.name} {theirs[what]}: {dataset} "
                    "has one kind of episode, so export each kind to a dataset of its own."
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
