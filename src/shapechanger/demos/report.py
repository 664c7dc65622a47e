"""The report of recorded demonstrations: one HTML file with images and charts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate, groupby, pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, Driver, Episode, Step
from shapechanger.demos.episodes.records import Keep
from shapechanger.demos.jpeg import COLOURS, decode_picture
from shapechanger.demos.statistics import gaps_s
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
_BINS: Final = 21  # Odd, so that 0 has its own bin in a symmetric range.
_COLLISION: Final = "reward_collision"
_MS: Final = 1e3


class Distribution(NamedTuple):
    """Numbers of the same name and unit.

    Attributes:
        name: What they are.
        unit: Their unit.
        values: The finite ones, shape (n,), at least one.
        missing: Number of the others, NaN and infinities.
        low: Lowest value that makes sense; minus infinity for none.
        high: Highest value that makes sense; infinity for none.
    """

    name: str
    unit: str
    values: NDArray[np.float64]
    missing: int
    low: float
    high: float


def distributions(episodes: Sequence[Episode]) -> list[Distribution]:
    """Return the distributions of actions, measurements and times between steps.

    Numbers of the same name and unit are pooled over episodes. Dropped steps do not count.
    """
    found: dict[tuple[str, str], tuple[list[float], float, float]] = {}

    def add(
        name: str,
        unit: str,
        values: Iterable[float],
        low: float = -math.inf,
        high: float = math.inf,
    ) -> None:
        numbers, *_ = found.setdefault((name, unit), ([], low, high))
        numbers.extend(values)

    for episode in episodes:
        layout = Layout.from_json(episode.header.action_layout)
        for name, place in list(layout.slices.items())[:_MAX_ACTIONS]:
            values = (v for step in episode.kept for v in step.action[place])
            add(name, layout[name].unit, values, layout[name].low, layout[name].high)
    for episode in episodes:
        states = episode.header.state_layout
        layout = Layout.from_json(states) if states else Layout(())
        for name in (n for n in _MEASURED if n in layout):
            place = layout.slices[name]
            values = (v for step in episode.kept for v in step.state[place])
            add(name, layout[name].unit, values)
    for episode in episodes:
        add("time between steps", "ms", (_MS * gap for gap in gaps_s(episode)))
    pooled: list[Distribution] = []
    for (name, unit), (values, low, high) in found.items():
        finite = np.array([value for value in values if math.isfinite(value)])
        if len(finite):
            pooled.append(Distribution(name, unit, finite, len(values) - len(finite), low, high))
    return pooled


def recording_html(name: str, episodes: Sequence[Episode], broken: Sequence[str] = ()) -> str:
    """Render the report.

    Args:
        name: Name of the recording.
        episodes: Its episodes.
        broken: A sentence for each episode that cannot be read.

    Raises:
        MissingExtra: If Jinja2 is not installed.
    """
    per_episode = _MAX_PICTURES // max(1, len(episodes))
    pictures = min(_MAX_PER_EPISODE, max(_MIN_PER_EPISODE, per_episode))
    steps = Counter(step.driver for one in episodes for step in one.kept)
    shown: dict[Driver, int] = {driver: steps[driver] for driver in DRIVERS if steps[driver]}
    return render(
        Path(__file__).with_name("recording.html"),
        title=name,
        cards=_cards(episodes),
        broken=broken,
        shares=shares_text(shown),
        drivers=[
            {
                "name": driver,
                "colour": _colour(driver),
                "steps": count,
                "percent": f"{100.0 * count / steps.total():.0f}",
            }
            for driver, count in shown.items()
        ],
        dropped_colour=_DROPPED,
        histograms=[_histogram(one) for one in distributions(episodes)],
        episodes=[
            {
                "episode": episode,
                "timeline": _timeline(episode) if episode.steps else None,
                "frames": _frames(episode, pictures),
            }
            for episode in episodes
        ],
        open_all=len(episodes) <= _MAX_OPEN_EPISODES,
    )


def _colour(driver: Driver) -> str:
    return "#{:02x}{:02x}{:02x}".format(*COLOURS[driver])


def _cards(episodes: Sequence[Episode]) -> list[tuple[str, str, str]]:
    """Label, value and note of each headline number."""
    kept = [step for one in episodes for step in one.kept]
    rewards = [one.reward for one in episodes if one.reward is not None]
    collisions = sum(step.terms.get(_COLLISION, 0.0) < 0.0 for step in kept)
    cards = [
        ("Episodes", str(len(episodes)), ""),
        ("Length", duration_text(sum(one.seconds for one in episodes)), "of kept steps"),
        ("Kept steps", str(len(kept)), f"of {sum(len(one.steps) for one in episodes)}"),
        ("Collisions", str(collisions), "felt by the robot"),
    ]
    if rewards:
        cards.append(("Reward", f"{sum(rewards):.1f}", "of kept steps"))
    return cards


def _histogram(found: Distribution) -> dict[str, Any]:
    name, values = found.name, found.values
    unit = "" if found.unit in ("", "1") else f" {found.unit}"
    least, median, most = values.min(), np.median(values), values.max()
    begin = found.low if math.isfinite(found.low) else least
    end = found.high if math.isfinite(found.high) else most
    if not begin < end:  # All values are equal.
        begin, end = begin - 0.5, begin + 0.5
    # Values outside the range are counted in the outer bins.
    counts, edges = np.histogram(np.clip(values, begin, end), _BINS, (begin, end))
    bars: list[tuple[float, str]] = []
    for count, (low, high) in zip(counts, pairwise(edges), strict=True):
        share = 100.0 * count / len(values)
        title = f"{low:.3g} to {high:.3g}{unit}: {count} steps, {share:.1f} %"
        bars.append((float(count / counts.max()), title))
    missing = f" · {found.missing} without a value" if found.missing else ""
    return {
        "label": f"{name}: {least:.3g} to {most:.3g}{unit}, median {median:.3g}",
        "bars": bars,
        "low": f"{begin:.3g}",
        "median": f"median {median:.3g}{unit}",
        "high": f"{end:.3g}",
        "caption": f"{name}{' in' if unit else ''}{unit}{missing}",
    }


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
            whys = (
                drop.why
                for drop in reversed(episode.drops)
                if drop.first <= step.index <= drop.last and not isinstance(drop, Keep)
            )
            caption.append(next(filter(None, whys), "dropped"))
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
