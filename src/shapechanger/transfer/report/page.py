"""One page that holds everything a study found, and needs no other file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.pages.markup import Html, element, joined, paragraph, text
from shapechanger.pages.page import page_text
from shapechanger.pages.pictures import png_uri, svg_uri
from shapechanger.transfer.files import write_whole
from shapechanger.transfer.report import evidence, results
from shapechanger.transfer.report.verdict import verdict
from shapechanger.transfer.study import Study

__all__ = ["Pictures", "report_html", "write_report"]

Pictures = tuple[NDArray[np.uint8], NDArray[np.uint8]]
"""The source's body and the target's, each of shape (height, width, 3)."""


_CURVES_NOTE: Final = (
    "A thin line is one seed, a thick one the mean over seeds, a band its 95 % t-interval over "
    "seeds, cut off at the edges of the picture. A level is that of a policy that is not trained "
    "on the target. Counted in total steps, everything that comes from the source starts after its "
    "source steps."
)


def write_report(
    study: Study, path: Path, pictures: Pictures | None = None, picture_note: str = ""
) -> None:
    """Write the report of a study.

    Args:
        study: The study.
        path: The file, such as `results/demo/report.html`; its folder must exist.
        pictures: The two bodies; None if there are none.
        picture_note: Why there are no pictures, or what they show.

    Raises:
        MissingExtra: If matplotlib is not installed.
        OutputError: If the file cannot be written.
    """
    write_whole(path, report_html(study, pictures, picture_note).encode())


def report_html(study: Study, pictures: Pictures | None = None, picture_note: str = "") -> str:
    """The report of a study as text, see `write_report`."""
    task = study.plan.task
    title = f"{evidence.short_name(task.source)} → {evidence.short_name(task.target)}"
    sections: tuple[tuple[str, str, Callable[[Study], Html]], ...] = (
        ("curves", "Learning curves on the target", _curves),
        ("measures", "Measures", results.measures),
        ("arms", "Arms", results.arms),
        ("shift", "What changes from source to target", evidence.shift),
        ("map", "Body map", evidence.body_map),
        ("learner", "Learner", evidence.learner),
        ("provenance", "Provenance", evidence.provenance),
    )
    body = joined(
        (
            element(
                "header",
                paragraph("Transfer study", class_="kind"),
                element("h1", text(title)),
                paragraph(verdict(study), class_="verdict"),
                results.headline(study),
            ),
            element(
                "main",
                _section("bodies", "The two bodies", _bodies(study, pictures, picture_note)),
                *(_section(name, heading, make(study)) for name, heading, make in sections),
            ),
        )
    )
    return page_text(title, body)


def _section(name: str, heading: str, content: Html) -> Html:
    return element("section", element("h2", text(heading)), content, id=name)


def _bodies(study: Study, pictures: Pictures | None, note: str) -> Html:
    """Both bodies side by side."""
    told = [paragraph(note, class_="note")] if note else []
    if pictures is None:
        return joined(told or [paragraph("There are no pictures.", class_="note")])
    plan = study.plan
    names = (
        ("Source", plan.task.source, plan.body_map.source_observation, plan.body_map.source_action),
        ("Target", plan.task.target, plan.body_map.target_observation, plan.body_map.target_action),
    )
    figures = [
        _figure(
            png_uri(picture),
            f"The body of {env}",
            f"{side}: {evidence.short_name(env)}, {_counted(observation.size, 'observation')}, "
            f"{_counted(action.size, 'action')}",
        )
        for picture, (side, env, observation, action) in zip(pictures, names, strict=True)
    ]
    return joined((element("div", *figures, class_="pair"), *told))


def _curves(study: Study) -> Html:
    """Both panels side by side."""
    # Matplotlib is needed here only, so that a terminal can show the table without it.
    from shapechanger.transfer.report.curves import learning_curves

    panels = [
        _figure(
            svg_uri(learning_curves(study, "target")),
            "Mean return of each arm over target steps",
            "Counted in target steps",
        ),
        _figure(
            svg_uri(learning_curves(study, "total")),
            "Mean return of each arm over source and target steps",
            "Counted in total steps",
        ),
    ]
    return joined((element("div", *panels, class_="pair"), paragraph(_CURVES_NOTE, class_="note")))


def _figure(source: str, alternative: str, caption: str) -> Html:
    image = Html(f'<img src="{text(source)}" alt="{text(alternative)}">')
    return element("figure", image, element("figcaption", text(caption)))


def _counted(number: int, what: str) -> str:
    """As in `1 action` and `2 actions`."""
    return f"{number} {what}{'' if number == 1 else 's'}"
