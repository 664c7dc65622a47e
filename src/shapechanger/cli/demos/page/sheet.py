"""Pictures of an episode side by side, as on a photographer's contact sheet."""

from __future__ import annotations

import base64
from typing import Final

import numpy as np
import simplejpeg

from shapechanger.cli.demos.page.charts import colour_of
from shapechanger.demos.dataset import decode_picture
from shapechanger.demos.episodes import Episode, Step
from shapechanger.errors import DemosError
from shapechanger.pages.markup import Html, element, joined, paragraph, text

__all__ = ["contact_sheet"]

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
