"""Drawings in SVG: how numbers are spread, and what happened when."""

from __future__ import annotations

import math
from itertools import groupby
from typing import Final

from shapechanger.demos.episodes import Driver, Episode
from shapechanger.demos.overlay import COLOURS
from shapechanger.demos.statistics import Spread
from shapechanger.layout import Layout
from shapechanger.pages.markup import Html, element, joined, text

__all__ = ["DROPPED", "colour_of", "histogram", "timeline"]

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


def histogram(name: str, unit: str, found: Spread) -> Html:
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


def _bin(found: Spread, place: int, count: int, unit: str) -> str:
    width = (found.high - found.low) / len(found.counts)
    low = found.low + place * width
    share = 100.0 * count / found.total
    return f"{low:.3g} to {low + width:.3g}{_unit(unit)}: {count} steps, {share:.1f} %"


def _unit(unit: str, before: str = " ") -> str:
    return "" if unit in ("", "1") else f"{before}{unit}"
