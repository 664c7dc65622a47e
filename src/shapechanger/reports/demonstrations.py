"""One page that shows a recording, and needs no other file."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Sequence
from importlib.resources import files
from itertools import groupby
from typing import Final

import numpy as np
import simplejpeg

from shapechanger.cli.demos.show import shares, told_length
from shapechanger.demos.dataset import decode_picture
from shapechanger.demos.episodes import DRIVERS, Driver, Episode, Step
from shapechanger.demos.overlay import COLOURS
from shapechanger.demos.statistics import Distribution, EpisodeStatistics, gaps_s, spread, summary
from shapechanger.errors import DemosError
from shapechanger.layout import Layout
from shapechanger.reports.page import (
    Html,
    details,
    element,
    joined,
    page_text,
    pairs,
    paragraph,
    table,
    text,
)

__all__ = [
    "DROPPED",
    "colour_of",
    "contact_sheet",
    "distributions",
    "histogram",
    "recording_html",
    "timeline",
]

DROPPED: Final = "#d5d9de"
"""Colour of steps that do not count."""

_INK: Final = "#59636e"
_BAR: Final = "#0072b2"
# Of the numbers of an action, one after the other; by Okabe and Ito, as those of the drivers.
_LINES: Final = ("#1b1f24", "#d55e00", "#cc79a7", "#56b4e9")
# In units of the drawing, which is as wide as the page lets it be.
_WIDE, _HIGH, _UNDER = 320, 120, 18
_LONG, _STRIP, _TRACE = 1000, 14, 70
_MOST_POINTS: Final = 1000


def colour_of(driver: Driver) -> str:
    """Colour of a driver, as HTML writes it."""
    return "#{:02x}{:02x}{:02x}".format(*COLOURS[driver])


def histogram(name: str, unit: str, found: Distribution) -> Html:
    """How some numbers are spread: a bar for each bin, the ends of the range below."""
    most = max(found.counts)
    step = _WIDE / len(found.counts)
    bars = [
        element(
            "rect",
            element("title", text(_bin(found, place, count, unit))),
            x=f"{place * step + 0.5:.1f}",
            y=f"{_HIGH * (1.0 - count / most):.1f}",
            width=f"{step - 1.0:.1f}",
            height=f"{_HIGH * count / most:.1f}",
            fill=_BAR,
        )
        for place, count in enumerate(found.counts)
    ]
    ends = [
        _label(f"{found.low:.3g}", 0, "start"),
        _label(f"median {found.median:.3g}{_unit(unit)}", _WIDE / 2, "middle"),
        _label(f"{found.high:.3g}", _WIDE, "end"),
    ]
    told = f"{name}: {found.least:.3g} to {found.most:.3g}{_unit(unit)}, median {found.median:.3g}"
    line = element(
        "line", x1="0", x2=str(_WIDE), y1=str(_HIGH), y2=str(_HIGH), stroke=_INK
    )  # fmt: skip
    drawing = _svg(_WIDE, _HIGH + _UNDER, told, *bars, line, *ends)
    missing = f" · {found.missing} without a value" if found.missing else ""
    return element(
        "figure", drawing, element("figcaption", text(f"{name}{_unit(unit, ' in ')}{missing}"))
    )


def timeline(episode: Episode) -> Html:
    """Who drove when, what does not count, where the marks are, and the actions over time."""
    layout = Layout.from_json(episode.header.action_layout)
    kept = {step.index for step in episode.kept}
    first, last = episode.steps[0].index, episode.steps[-1].index
    scale = _LONG / max(1, last - first + 1)

    def at(index: int) -> float:
        return (index - first) * scale

    parts: list[Html] = []
    runs = groupby(episode.steps, lambda step: (step.index in kept, step.driver))
    for (counts, driver), group in runs:
        steps = list(group)
        begin, end = at(steps[0].index), at(steps[-1].index + 1)
        why = driver if counts else "does not count"
        parts.append(
            element(
                "rect",
                element("title", text(f"{why}: steps {steps[0].index} to {steps[-1].index}")),
                x=f"{begin:.1f}",
                y="10",
                width=f"{max(end - begin, 0.5):.1f}",
                height=str(_STRIP),
                fill=colour_of(driver) if counts else DROPPED,
            )
        )
    for mark in episode.marks:
        place = at(mark.step) + scale / 2
        parts.append(
            element(
                "path",
                element("title", text(f"step {mark.step}: {mark.text or 'marked'}")),
                d=f"M{place:.1f} 10l-5 -9h10z",
                fill="#1b1f24",
            )
        )
    top = 10 + _STRIP + 6
    middle = top + _TRACE / 2
    parts.append(
        element("line", x1="0", x2=str(_LONG), y1=f"{middle}", y2=f"{middle}", stroke=DROPPED)
    )
    stride = max(1, math.ceil(len(episode.steps) / _MOST_POINTS))
    for place, name in enumerate(layout.names[: len(_LINES)]):
        low, high = float(layout.low[place]), float(layout.high[place])
        reach = max((abs(b) for b in (low, high) if math.isfinite(b)), default=1.0) or 1.0
        points = " ".join(
            f"{at(step.index) + scale / 2:.1f},"
            f"{middle - _TRACE / 2 * min(max(step.action[place] / reach, -1.0), 1.0):.1f}"
            for step in episode.steps[::stride]
        )
        parts.append(
            element(
                "polyline",
                element("title", text(name)),
                points=points,
                fill="none",
                stroke=_LINES[place],
                stroke_width="1.3",
            )
        )
    told = (
        f"{len(episode.steps)} steps, of which {len(kept)} count; {len(episode.marks)} marks; "
        f"{' and '.join(layout.names)} over time"
    )
    names = [
        element("span", text(name), style=f"color:{_LINES[place]}")
        for place, name in enumerate(layout.names[: len(_LINES)])
    ]
    note = element(
        "figcaption",
        joined([*names, text("from " + _ends(layout) + ", over "), text(_time(episode))]),
    )
    return element("figure", _svg(_LONG, top + _TRACE + 4, told, *parts), note, class_="timeline")


def _ends(layout: Layout) -> str:
    reach = [abs(b) for b in (*layout.low.tolist(), *layout.high.tolist()) if math.isfinite(b)]
    most = max(reach, default=1.0)
    return f"-{most:g} (below) to {most:g} (above)"


def _time(episode: Episode) -> str:
    seconds = len(episode.steps) / episode.header.control_hz
    return f"{seconds:.1f} s"


def _svg(width: float, height: float, told: str, *inner: Html) -> Html:
    return element(
        "svg",
        *inner,
        viewBox=f"0 0 {width:g} {height:g}",
        role="img",
        aria_label=told,
        xmlns="http://www.w3.org/2000/svg",
    )


def _label(words: str, x: float, anchor: str) -> Html:
    return element(
        "text", text(words), x=f"{x:g}", y=str(_HIGH + 14), fill=_INK, text_anchor=anchor,
        font_size="12",
    )  # fmt: skip


def _bin(found: Distribution, place: int, count: int, unit: str) -> str:
    width = (found.high - found.low) / len(found.counts)
    low = found.low + place * width
    share = 100.0 * count / found.total
    return f"{low:.3g} to {low + width:.3g}{_unit(unit)}: {count} steps, {share:.1f} %"


def _unit(unit: str, before: str = " ") -> str:
    return "" if unit in ("", "1") else f"{before}{unit}"


_WIDEST: Final = 200  # Pixels; a wider picture is made smaller, so that a page stays a page.
_MOST_MARKS: Final = 12


def contact_sheet(episode: Episode, most: int) -> Html:
    """Pictures of an episode, evenly spread and at its marks.

    Args:
        episode: The episode.
        most: How many pictures, besides the marked ones.
    """
    seen = [step for step in episode.steps if step.frame]
    if not seen:
        return paragraph("It has no pictures.", class_="note")
    marks = {mark.step: mark.text or "marked" for mark in episode.marks}
    places: list[float] = np.linspace(0, len(seen) - 1, min(most, len(seen))).tolist()
    evenly = {seen[round(place)].index for place in places}
    marked = [index for index in marks if index in {step.index for step in seen}][:_MOST_MARKS]
    chosen = evenly | set(marked)
    kept = {step.index for step in episode.kept}
    return element(
        "div",
        *(
            _figure(episode, step, marks.get(step.index, ""), counts=step.index in kept)
            for step in seen
            if step.index in chosen
        ),
        class_="sheet",
    )


def _figure(episode: Episode, step: Step, mark: str, *, counts: bool) -> Html:
    seconds = (step.index - episode.steps[0].index) / episode.header.control_hz
    told = [f"step {step.index}", f"{seconds:.1f} s"]
    if not counts:
        told.append(_why(episode, step))
    caption = [text(" · ".join(told))]
    if mark:
        caption.append(element("strong", text(f" ▲ {mark}")))
    source = _source(episode, step)
    picture = (
        element("img", src=source, alt=f"What was seen at step {step.index}", loading="lazy")
        if source
        else paragraph("damaged", class_="note")
    )
    return element(
        "figure",
        picture,
        element("figcaption", joined(caption)),
        class_="kept" if counts else "dropped",
        style=f"--driver:{colour_of(step.driver)}",
    )


def _why(episode: Episode, step: Step) -> str:
    """Why a step does not count: what was said last."""
    said = [drop for drop in episode.drops if drop.first <= step.index <= drop.last]
    return next((drop.why for drop in reversed(said) if not drop.keep and drop.why), "dropped")


def _source(episode: Episode, step: Step) -> str:
    """A picture as a data URI; empty if it is damaged."""
    try:
        jpeg = episode.jpeg(step)
        if jpeg is None:
            return ""
        picture = decode_picture(jpeg, step.frame)
    except DemosError:  # The page shows that, and the rest of the episode all the same.
        return ""
    times = -(-picture.shape[1] // _WIDEST)
    if times > 1:
        small = np.ascontiguousarray(picture[::times, ::times])
        jpeg = simplejpeg.encode_jpeg(small, quality=85)
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode('ascii')}"


# Of a state, what people want to know first; what the outputs did is shown with the actions.
_SENSED: Final = ("speed", "distance", "battery")
_MS: Final = 1e3
_MOST_ACTIONS: Final = 12


def distributions(episodes: Sequence[Episode]) -> list[tuple[str, str, Distribution]]:
    """Name, unit and spread of the actions, of what was sensed, and of the time between steps.

    Numbers of the same name and unit are taken together, whatever episode they are of.
    """
    found: dict[tuple[str, str], tuple[list[float], float, float]] = {}

    def add(name: str, unit: str, values: Iterable[float], low: float, high: float) -> None:
        numbers, *_ = found.setdefault((name, unit), ([], low, high))
        numbers.extend(values)

    for episode in episodes:
        actions = Layout.from_json(episode.header.action_layout)
        for name, place in list(actions.slices.items())[:_MOST_ACTIONS]:
            of_one = (v for step in episode.kept for v in step.action[place])
            add(name, actions[name].unit, of_one, actions[name].low, actions[name].high)
    for episode in episodes:
        if not episode.header.state_layout:
            continue
        states = Layout.from_json(episode.header.state_layout)
        for name in (n for n in _SENSED if n in states):
            place = states.slices[name]
            of_one = (v for step in episode.kept for v in step.state[place])
            add(name, states[name].unit, of_one, float("-inf"), float("inf"))
    for episode in episodes:
        times = (_MS * gap for gap in gaps_s(episode))
        add("time between steps", "ms", times, float("-inf"), float("inf"))
    counted = [
        (name, unit, spread(values, low, high))
        for (name, unit), (values, low, high) in found.items()
    ]
    return [(name, unit, one) for name, unit, one in counted if one is not None]


# So that the page of a hundred episodes can still be opened.
_PICTURES: Final = 600
_LEAST, _MOST = 6, 24
_OPEN: Final = 3  # Episodes that are not folded in.


def recording_html(name: str, episodes: Sequence[Episode], broken: Sequence[str] = ()) -> str:
    """The page as text.

    Args:
        name: What the recording is called.
        episodes: Its episodes.
        broken: A sentence for each episode that cannot be read.
    """
    told = [summary(episode) for episode in episodes]
    most = min(_MOST, max(_LEAST, _PICTURES // max(1, len(episodes))))
    body = joined(
        (
            element(
                "header",
                paragraph("Recording", class_="kind"),
                element("h1", text(name)),
                _cards(told),
                *(paragraph(sentence, class_="verdict") for sentence in broken),
            ),
            element(
                "main",
                _section("drivers", "Who drove", _drivers(told)),
                _section("numbers", "What was done and sensed", _histograms(episodes)),
                _section("episodes", "Episodes", _table(told)),
                *(
                    _episode(episode, one, most, is_open=len(episodes) <= _OPEN)
                    for episode, one in zip(episodes, told, strict=True)
                ),
            ),
        )
    )
    style = files("shapechanger.reports").joinpath("demonstrations.css").read_text("utf-8")
    return page_text(name, body, style)


def _section(name: str, heading: str, content: Html) -> Html:
    return element("section", element("h2", text(heading)), content, id=name)


def _cards(told: Sequence[EpisodeStatistics]) -> Html:
    kept, steps = sum(one.kept for one in told), sum(one.steps for one in told)
    rewards = [one.reward for one in told if one.reward is not None]
    cards = [
        ("Episodes", str(len(told)), ""),
        ("Length", told_length(sum(one.seconds for one in told)), "of steps that count"),
        ("Steps that count", str(kept), f"of {steps}"),
        ("Collisions", str(sum(one.collisions for one in told)), "that the robot felt"),
    ]
    if rewards:
        cards.append(("Reward", f"{sum(rewards):.1f}", "of steps that count"))
    return element(
        "div",
        *(
            element(
                "div",
                paragraph(label, class_="label"),
                paragraph(value, class_="value"),
                paragraph(more, class_="total"),
                class_="card",
            )
            for label, value, more in cards
        ),
        class_="cards",
    )


def _drivers(told: Sequence[EpisodeStatistics]) -> Html:
    counts = {driver: sum(one.drivers.get(driver, 0) for one in told) for driver in DRIVERS}
    total = sum(counts.values())
    if not total:
        return paragraph("No step counts.", class_="note")
    present: list[Driver] = [driver for driver in DRIVERS if counts[driver]]
    bar = element(
        "div",
        *(
            element(
                "span",
                style=f"flex:{counts[driver]};background:{colour_of(driver)}",
                title=f"{driver}: {counts[driver]} steps",
            )
            for driver in present
        ),
        class_="shares",
        role="img",
        aria_label=shares({str(d): counts[d] for d in present}),
    )
    legend = [
        _legend(colour_of(d), f"{d} {100.0 * counts[d] / total:.0f} % ({counts[d]} steps)")
        for d in present
    ]
    legend += [_legend(DROPPED, "does not count"), element("span", text("▲ mark"))]
    return joined((bar, element("p", *legend, class_="legend")))


def _legend(colour: str, words: str) -> Html:
    return element("span", element("i", style=f"background:{colour}"), text(words))


def _histograms(episodes: Sequence[Episode]) -> Html:
    drawn = [histogram(name, unit, found) for name, unit, found in distributions(episodes)]
    if not drawn:
        return paragraph("No step counts.", class_="note")
    note = "Of the steps that count; the highest bar of each drawing fills it."
    return joined((element("div", *drawn, class_="charts"), paragraph(note, class_="note")))


def _table(told: Sequence[EpisodeStatistics]) -> Html:
    header = ("Episode", "Of", "Steps", "Length", "Drivers", "Marks", "Reward", "Outcome")
    rows = [
        (
            element("a", text(one.name), href=f"#{one.name}"),
            text(one.what),
            text(f"{one.kept}" if one.kept == one.steps else f"{one.kept} of {one.steps}"),
            text(told_length(one.seconds)),
            text(shares({str(d): n for d, n in one.drivers.items()}) if one.drivers else ""),
            text(str(one.marks or "")),
            text("" if one.reward is None else f"{one.reward:.1f}"),
            text(one.outcome if one.closed else "not closed"),
        )
        for one in told
    ]
    many = "1 episode" if len(told) == 1 else f"{len(told)} episodes, the oldest first"
    return table(many, header, rows)


def _episode(episode: Episode, one: EpisodeStatistics, most: int, *, is_open: bool) -> Html:
    header = episode.header
    if not episode.steps:
        content: tuple[Html, ...] = (paragraph("It has no steps.", class_="note"),)
    else:
        content = (timeline(episode), contact_sheet(episode, most))
    facts = [
        ("began", header.created),
        ("of", one.what),
        ("driver", header.driver),
        ("outcome", one.outcome if one.closed else "not closed"),
        ("seed", "" if header.seed is None else str(header.seed)),
        ("made by", header.source),
        ("marks", "; ".join(f"step {m.step}: {m.text or 'marked'}" for m in episode.marks)),
    ]
    inner = (*content, pairs((name, text(value)) for name, value in facts if value))
    heading = f"{one.name} · {told_length(one.seconds)} · {one.outcome or 'just ended'}"
    if is_open:
        return element("section", element("h3", text(heading)), *inner, id=one.name)
    return element("section", details(heading, *inner), id=one.name)
