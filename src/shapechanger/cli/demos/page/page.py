"""The page of a recording: what is in it, in numbers and in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Final

from shapechanger.cli.demos.listing import shares, told_length
from shapechanger.cli.demos.page.charts import DROPPED, colour_of, histogram, timeline
from shapechanger.cli.demos.page.sheet import contact_sheet
from shapechanger.cli.demos.spreads import spreads
from shapechanger.demos.episodes import DRIVERS, Driver, Episode
from shapechanger.demos.statistics import EpisodeSummary, summary
from shapechanger.pages.markup import (
    Html,
    details,
    element,
    joined,
    pairs,
    paragraph,
    table,
    text,
)
from shapechanger.pages.page import page_text

__all__ = ["recording_html"]

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
    style = files("shapechanger.cli.demos.page").joinpath("page.css").read_text("utf-8")
    return page_text(name, body, style)


def _section(name: str, heading: str, content: Html) -> Html:
    return element("section", element("h2", text(heading)), content, id=name)


def _cards(told: Sequence[EpisodeSummary]) -> Html:
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


def _drivers(told: Sequence[EpisodeSummary]) -> Html:
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
    drawn = [histogram(name, unit, found) for name, unit, found in spreads(episodes)]
    if not drawn:
        return paragraph("No step counts.", class_="note")
    note = "Of the steps that count; the highest bar of each drawing fills it."
    return joined((element("div", *drawn, class_="charts"), paragraph(note, class_="note")))


def _table(told: Sequence[EpisodeSummary]) -> Html:
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


def _episode(episode: Episode, one: EpisodeSummary, most: int, *, is_open: bool) -> Html:
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
