"""The report of recorded demonstrations: one HTML file with images and charts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import accumulate, groupby, pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, Episode
from shapechanger.demos.jpeg import COLOURS, decode_picture, encode_picture
from shapechanger.errors import DemosError
from shapechanger.layout import Feature
from shapechanger.reports.page import jpeg_uri, render

# Images on a page of up to 100 episodes, in addition to marked ones: browsers can open such a page.
# With more episodes, each has `_MIN_PER_EPISODE` images.
_MAX_PICTURES: Final = 600
_MIN_PER_EPISODE, _MAX_PER_EPISODE = 6, 24
_MAX_MARKED: Final = 12
_MAX_OPEN_EPISODES: Final = 3
_MAX_WIDTH: Final = 200  # Pixels; wider images are downsampled.

_COLOURS: Final = {driver: "#{:02x}{:02x}{:02x}".format(*COLOURS[driver]) for driver in DRIVERS}
_DROPPED: Final = "#d5d9de"
# Colours of the traces of an action's numbers, from the palette of Okabe and Ito.
_TRACE_COLOURS: Final = ("#1b1f24", "#d55e00", "#cc79a7", "#56b4e9")
_MAX_POINTS: Final = 1000

# Numbers of a state that are shown as histograms.
_MEASURED: Final = ("speed", "distance", "battery")
_MAX_ACTIONS: Final = 12
_BINS: Final = 21  # Odd, so that 0 has its own bin in a symmetric range.


class Distribution(NamedTuple):
    """Finite numbers, shape (n,), of one name and unit; `missing` others are NaN or infinite."""

    feature: Feature
    values: NDArray[np.float64]
    missing: int


def distributions(episodes: Sequence[Episode]) -> list[Distribution]:
    """Return the distributions of the first actions, some measurements, and times between steps.

    Numbers of the same name and unit are pooled over episodes. Dropped steps do not count.
    """
    found: dict[tuple[str, str], tuple[Feature, list[float]]] = {}

    def add(feature: Feature, values: Iterable[float]) -> None:
        found.setdefault((feature.name, feature.unit), (feature, []))[1].extend(values)

    for one in episodes:
        layout = one.header.action_layout
        for name, place in list(layout.slices.items())[:_MAX_ACTIONS]:
            add(layout[name], (value for step in one.kept for value in step.action[place]))
        layout, places = one.header.state_layout, one.header.state_layout.slices
        for name in filter(places.get, _MEASURED):
            values = (value for step in one.kept for value in step.state[places[name]])
            add(Feature(name, layout[name].unit), values)
        add(Feature("time between steps", "ms"), (1e3 * gap for gap in one.gaps_s))
    pooled: list[Distribution] = []
    for feature, values in found.values():
        finite = np.array([value for value in values if math.isfinite(value)])
        if len(finite):
            pooled.append(Distribution(feature, finite, len(values) - len(finite)))
    return pooled


def recording_html(name: str, episodes: Sequence[Episode], broken: Sequence[str] = ()) -> str:
    """Render the report of a recording; `broken` are messages on episodes that cannot be read."""
    per_episode = _MAX_PICTURES // max(1, len(episodes))
    pictures = min(_MAX_PER_EPISODE, max(_MIN_PER_EPISODE, per_episode))
    kept = [step for one in episodes for step in one.kept]
    steps = Counter(step.driver for step in kept)
    return render(
        Path(__file__).with_name("recording.html"),
        title=name,
        kept=kept,
        broken=broken,
        drivers={driver: steps[driver] for driver in DRIVERS if steps[driver]},
        colours=_COLOURS | {"dropped": _DROPPED},
        histograms=[_histogram(one) for one in distributions(episodes)],
        episodes=[
            {
                "episode": one,
                "timeline": _timeline(one) if one.steps else None,
                "frames": _frames(one, pictures),
            }
            for one in episodes
        ],
        open_all=len(episodes) <= _MAX_OPEN_EPISODES,
    )


def _histogram(found: Distribution) -> dict[str, Any]:
    feature, values = found.feature, found.values
    low = feature.low if math.isfinite(feature.low) else values.min()
    high = feature.high if math.isfinite(feature.high) else values.max()
    if not low < high:  # All values are equal.
        low, high = low - 0.5, high + 0.5
    # Values outside the range are counted in the outer bins.
    counts, edges = np.histogram(np.clip(values, low, high), _BINS, (low, high))
    return {
        "name": feature.name,
        "unit": "" if feature.unit in ("", "1") else f" {feature.unit}",
        "bins": list(zip(counts.tolist(), pairwise(edges.tolist()), strict=True)),
        "range": (low, high),
        "least": values.min(),
        "median": np.median(values),
        "most": values.max(),
        "missing": found.missing,
    }


def _timeline(episode: Episode) -> dict[str, Any]:
    """Return the runs of each driver, and points, -1 to 1, of the first four actions over time."""
    layout, first = episode.header.action_layout, episode.steps[0].index
    runs: list[tuple[int, int, str]] = []
    whose = ("dropped" if s.index in episode.excluded else s.driver for s in episode.steps)
    for who, run in groupby(zip(whose, episode.steps, strict=True), lambda pair: pair[0]):
        indexes = [step.index for _, step in run]
        runs.append((indexes[0], indexes[-1], who))
    drawn = episode.steps[:: math.ceil(len(episode.steps) / _MAX_POINTS)]
    bounds = np.abs([layout.low, layout.high])
    reaches = np.where(np.isfinite(bounds), bounds, 0.0).max(axis=0)
    reaches[reaches == 0.0] = 1.0  # Unbounded values are drawn from -1 to 1.
    heights = np.clip(np.array([step.action for step in drawn]) / reaches, -1.0, 1.0)
    places = [step.index - first for step in drawn]
    traces = zip(layout.names, _TRACE_COLOURS, heights.T.tolist(), strict=False)
    return {
        "first": first,
        "length": episode.steps[-1].index - first + 1,
        "runs": runs,
        "names": layout.names,
        "traces": [(*who, list(zip(places, y, strict=True))) for *who, y in traces],
        "reach": reaches.max(),
    }


def _frames(episode: Episode, most: int) -> list[dict[str, Any]]:
    """Return up to `most` evenly spaced images of an episode, and those at the first marks."""
    # Time at which each step starts, s.
    starts_s = accumulate(episode.durations_s, initial=0.0)
    seen = [pair for pair in zip(episode.steps, starts_s, strict=False) if pair[0].frame]
    places = np.linspace(0, len(seen) - 1, min(most, len(seen))).round().astype(int).tolist()
    marks = {mark.step: mark.text or "marked" for mark in episode.marks}
    marked = [n for n, (step, _) in enumerate(seen) if step.index in marks]
    frames: list[dict[str, Any]] = []
    for step, at_s in (seen[n] for n in sorted({*places, *marked[:_MAX_MARKED]})):
        source = ""
        with suppress(DemosError):  # The page marks it as damaged and shows the rest.
            jpeg = episode.jpeg(step) or b""
            picture = decode_picture(jpeg, step.frame)
            times = -(-picture.shape[1] // _MAX_WIDTH)
            source = jpeg_uri(encode_picture(picture[::times, ::times], 85) if times > 1 else jpeg)
        frames.append(
            {
                "step": step.index,
                "seconds": at_s,
                "driver": step.driver,
                "who": "dropped" if step.index in episode.excluded else step.driver,
                "why": episode.excluded.get(step.index, ""),
                "source": source,
                "mark": marks.get(step.index, ""),
            }
        )
    return frames
