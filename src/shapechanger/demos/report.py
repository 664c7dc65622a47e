"""The report of recorded demonstrations: one HTML file with images and charts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate, groupby
from pathlib import Path
from typing import Any, Final

import numpy as np
import simplejpeg

from shapechanger.demos.episodes import DRIVERS, Driver, Episode, Step
from shapechanger.demos.jpeg import COLOURS, decode_picture
from shapechanger.demos.statistics import Distribution, EpisodeStatistics, gaps_s, spread, summary
from shapechanger.errors import DemosError
from shapechanger.layout import Layout
from shapechanger.reports.numbers import duration_text, shares_text
from shapechanger.reports.page import jpeg_uri, render

# Images on a page, so that the page of a hundred episodes still opens.
_MAX_PICTURES: Final = 600
_MIN_PER_EPISODE, _MAX_PER_EPISODE = 6, 24
_MAX_MARKED: Final = 12
_MAX_OPEN_EPISODES: Final = 3
_MAX_WIDTH: Final = 200  # Pixels; wider images are downsampled.

_DROPPED: Final = "#d5d9de"
# Colours of the numbers of an action, by Okabe and Ito, as those of the drivers.
_TRACE_COLOURS: Final = ("#1b1f24", "#d55e00", "#cc79a7", "#56b4e9")
_MAX_POINTS: Final = 1000

# Numbers of a state that are shown; outputs are shown with the actions.
_MEASURED: Final = ("speed", "distance", "battery")
_MAX_ACTIONS: Final = 12
_MS: Final = 1e3


def distributions(episodes: Sequence[Episode]) -> list[tuple[str, str, Distribution]]:
    """Name, unit and distribution of actions, measurements and times between steps.

    Numbers of the same name and unit are pooled over episodes. Dropped steps do not count.
    """
    found: dict[tuple[str, str], tuple[list[float], float, float]] = {}

    def add(name: str, unit: str, values: Iterable[float], low: float, high: float) -> None:
        numbers, *_ = found.setdefault((name, unit), ([], low, high))
        numbers.extend(values)

    for episode in episodes:
        actions = Layout.from_json(episode.header.action_layout)
        for name, place in list(actions.slices.items())[:_MAX_ACTIONS]:
            values = (v for step in episode.kept for v in step.action[place])
            add(name, actions[name].unit, values, actions[name].low, actions[name].high)
    for episode in episodes:
        if not episode.header.state_layout:
            continue
        states = Layout.from_json(episode.header.state_layout)
        for name in (n for n in _MEASURED if n in states):
            place = states.slices[name]
            values = (v for step in episode.kept for v in step.state[place])
            add(name, states[name].unit, values, -math.inf, math.inf)
    for episode in episodes:
        add("time between steps", "ms", (_MS * gap for gap in gaps_s(episode)), -math.inf, math.inf)
    counted = [
        (name, unit, spread(values, low, high))
        for (name, unit), (values, low, high) in found.items()
    ]
    return [(name, unit, one) for name, unit, one in counted if one is not None]


def recording_html(name: str, episodes: Sequence[Episode], broken: Sequence[str] = ()) -> str:
    """Render the report.

    Args:
        name: Name of the recording.
        episodes: Its episodes.
        broken: A sentence for each episode that cannot be read.

    Raises:
        MissingExtra: If Jinja2 is not installed.
    """
    statistics = [summary(episode) for episode in episodes]
    per_episode = _MAX_PICTURES // max(1, len(episodes))
    pictures = min(_MAX_PER_EPISODE, max(_MIN_PER_EPISODE, per_episode))
    steps: Counter[str] = Counter()
    for one in statistics:
        steps.update(one.drivers)
    total = sum(steps.values())
    return render(
        Path(__file__).with_name("recording.html"),
        title=name,
        cards=_cards(statistics),
        broken=broken,
        shares=shares_text({d: steps[d] for d in DRIVERS if steps[d]}) if total else "",
        drivers=[
            {
                "name": driver,
                "colour": _colour(driver),
                "steps": steps[driver],
                "percent": f"{100.0 * steps[driver] / total:.0f}",
            }
            for driver in DRIVERS
            if steps[driver]
        ],
        dropped_colour=_DROPPED,
        histograms=[_histogram(*one) for one in distributions(episodes)],
        episodes=[
            _episode(episode, one, pictures)
            for episode, one in zip(episodes, statistics, strict=True)
        ],
        open_all=len(episodes) <= _MAX_OPEN_EPISODES,
    )


def _colour(driver: Driver) -> str:
    return "#{:02x}{:02x}{:02x}".format(*COLOURS[driver])


def _cards(statistics: Sequence[EpisodeStatistics]) -> list[tuple[str, str, str]]:
    """Label, value and note of each headline number."""
    kept, steps = sum(one.kept for one in statistics), sum(one.steps for one in statistics)
    rewards = [one.reward for one in statistics if one.reward is not None]
    cards = [
        ("Episodes", str(len(statistics)), ""),
        ("Length", duration_text(sum(one.seconds for one in statistics)), "of kept steps"),
        ("Kept steps", str(kept), f"of {steps}"),
        ("Collisions", str(sum(one.collisions for one in statistics)), "felt by the robot"),
    ]
    if rewards:
        cards.append(("Reward", f"{sum(rewards):.1f}", "of kept steps"))
    return cards


def _episode(episode: Episode, one: EpisodeStatistics, pictures: int) -> dict[str, Any]:
    header = episode.header
    outcome = one.outcome if one.closed else "not closed"
    facts = [
        ("began", header.created),
        ("of", one.what),
        ("driver", header.driver),
        ("outcome", outcome),
        ("seed", "" if header.seed is None else str(header.seed)),
        ("recorded by", header.source),
        ("marks", "; ".join(f"step {m.step}: {m.text or 'marked'}" for m in episode.marks)),
    ]
    return {
        "name": one.name,
        "heading": f"{one.name} · {duration_text(one.seconds)} · {one.outcome or 'just ended'}",
        "cells": (
            one.what,
            f"{one.kept}" if one.kept == one.steps else f"{one.kept} of {one.steps}",
            duration_text(one.seconds),
            shares_text({str(d): n for d, n in one.drivers.items()}) if one.drivers else "",
            one.marks or "",
            "" if one.reward is None else f"{one.reward:.1f}",
            outcome,
        ),
        "timeline": _timeline(episode) if episode.steps else None,
        "frames": _frames(episode, pictures),
        "facts": [(name, value) for name, value in facts if value],
    }


def _histogram(name: str, unit: str, found: Distribution) -> dict[str, Any]:
    width = (found.high - found.low) / len(found.counts)
    bars: list[tuple[float, str]] = []
    for place, count in enumerate(found.counts):
        low = found.low + place * width
        share = 100.0 * count / found.total
        title = f"{low:.3g} to {low + width:.3g}{_unit(unit)}: {count} steps, {share:.1f} %"
        bars.append((count / max(found.counts), title))
    extent = f"{found.least:.3g} to {found.most:.3g}{_unit(unit)}"
    missing = f" · {found.missing} without a value" if found.missing else ""
    return {
        "label": f"{name}: {extent}, median {found.median:.3g}",
        "bars": bars,
        "low": f"{found.low:.3g}",
        "median": f"median {found.median:.3g}{_unit(unit)}",
        "high": f"{found.high:.3g}",
        "caption": f"{name}{_unit(unit, ' in ')}{missing}",
    }


def _unit(unit: str, before: str = " ") -> str:
    return "" if unit in ("", "1") else f"{before}{unit}"


def _timeline(episode: Episode) -> dict[str, Any]:
    layout = Layout.from_json(episode.header.action_layout)
    kept = {step.index for step in episode.kept}
    first, last = episode.steps[0].index, episode.steps[-1].index
    bars: list[tuple[int, int, str, str]] = []
    for (is_kept, driver), group in groupby(
        episode.steps, lambda step: (step.index in kept, step.driver)
    ):
        steps = list(group)
        begin, end = steps[0].index, steps[-1].index
        title = f"{driver if is_kept else 'dropped'}: steps {begin} to {end}"
        colour = _colour(driver) if is_kept else _DROPPED
        bars.append((begin - first, end + 1 - begin, colour, title))
    drawn = episode.steps[:: math.ceil(len(episode.steps) / _MAX_POINTS)]
    traces: list[dict[str, Any]] = []
    for place, (name, colour) in enumerate(zip(layout.names, _TRACE_COLOURS, strict=False)):
        reach = _reach(float(layout.low[place]), float(layout.high[place])) or 1.0
        points = [
            (step.index - first, min(max(step.action[place] / reach, -1.0), 1.0)) for step in drawn
        ]
        traces.append({"name": name, "colour": colour, "points": points})
    reach = _reach(*layout.low.tolist(), *layout.high.tolist())
    return {
        "label": f"{len(episode.steps)} steps, {len(kept)} kept; {len(episode.marks)} marks; "
        f"{' and '.join(layout.names)} over time",
        "length": last - first + 1,
        "bars": bars,
        "marks": [
            (mark.step - first, f"step {mark.step}: {mark.text or 'marked'}")
            for mark in episode.marks
        ],
        "traces": traces,
        "range": f"-{reach:g} (below) to {reach:g} (above)",
        "seconds": f"{sum(episode.durations_s):.1f}",
    }


def _reach(*bounds: float) -> float:
    """Largest magnitude of the finite bounds; 1 without finite bounds."""
    return max((abs(bound) for bound in bounds if math.isfinite(bound)), default=1.0)


def _frames(episode: Episode, most: int) -> list[dict[str, Any]]:
    """Up to `most` evenly spaced images of an episode, and those at its marks."""
    seen = [step for step in episode.steps if step.frame]
    if not seen:
        return []
    marks = {mark.step: mark.text or "marked" for mark in episode.marks}
    places: list[float] = np.linspace(0, len(seen) - 1, min(most, len(seen))).tolist()
    evenly = {seen[round(place)].index for place in places}
    marked = [index for index in marks if index in {step.index for step in seen}][:_MAX_MARKED]
    chosen = evenly | set(marked)
    kept = {step.index for step in episode.kept}
    # Times of starts: without the duration of the step itself.
    starts_s = accumulate(episode.durations_s, initial=0.0)
    since_start_s = dict(zip((step.index for step in episode.steps), starts_s, strict=False))
    frames: list[dict[str, Any]] = []
    for step in seen:
        if step.index not in chosen:
            continue
        seconds = since_start_s[step.index]
        caption = [f"step {step.index}", f"{seconds:.1f} s"]
        if step.index not in kept:
            drops = [drop for drop in episode.drops if drop.first <= step.index <= drop.last]
            whys = (drop.why for drop in reversed(drops) if not drop.keep and drop.why)
            caption.append(next(whys, "dropped"))
        frames.append(
            {
                "step": step.index,
                "kept": step.index in kept,
                "colour": _colour(step.driver),
                "source": _thumbnail(episode, step),
                "caption": " · ".join(caption),
                "mark": marks.get(step.index, ""),
            }
        )
    return frames


def _thumbnail(episode: Episode, step: Step) -> str:
    """An image as a data URI; empty if it is damaged."""
    try:
        jpeg = episode.jpeg(step)
        if jpeg is None:
            return ""
        picture = decode_picture(jpeg, step.frame)
    except DemosError:  # The page marks it as damaged and shows the rest of the episode.
        return ""
    times = -(-picture.shape[1] // _MAX_WIDTH)
    if times > 1:
        small = np.ascontiguousarray(picture[::times, ::times])
        jpeg = simplejpeg.encode_jpeg(small, quality=85)
    return jpeg_uri(jpeg)
