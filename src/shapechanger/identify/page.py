"""What was found out about a finger, on one page."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import Any, Final

import numpy as np

from shapechanger.embodiments.finger import JOINTS
from shapechanger.identify.identified import Identified
from shapechanger.identify.words import interval, label, number, told
from shapechanger.pages.drawing import BLUE, GREY, ORANGE, drawn
from shapechanger.pages.markup import Html, element, joined, pairs, paragraph, table, text
from shapechanger.pages.page import page_text
from shapechanger.pages.pictures import svg_uri

__all__ = ["identified_html"]

_SIZE_IN: Final = (4.7, 2.6)
_NOTE: Final = (
    "The last fifth of the log, to whose motion nothing was fitted: both simulated fingers begin "
    "as the measured one and get the same commands, and see no measured angle after that."
)
_INTERVALS: Final = (
    "95 of 100 such intervals hold the true number. Those of joints and friction are "
    "widened by what such a fit was seen to be off by on fingers whose tendons stretch; see "
    "docs/identify.md. Bold: the nominal number is outside."
)


def identified_html(found: Identified, name: str) -> str:
    """The page as text.

    Args:
        found: What was found out.
        name: Of the log.

    Raises:
        MissingExtra: If matplotlib is not installed.
    """
    of = f"{found.seconds:.1f} s of {found.source}" if found.source else f"{found.seconds:.1f} s"
    body = joined(
        (
            element(
                "header",
                paragraph("Identified finger", class_="kind"),
                element("h1", text(name)),
                paragraph(told(found).capitalize() + ".", class_="verdict"),
                paragraph(of, class_="note"),
            ),
            element(
                "main",
                _section("check", "Measured and simulated", _curves(found)),
                _section("numbers", "Parameters", _table(found)),
                _section("untold", "What this log cannot tell", _untold(found)),
            ),
        )
    )
    return page_text(name, body)


def _section(name: str, heading: str, content: Html) -> Html:
    return element("section", element("h2", text(heading)), content, id=name)


def _curves(found: Identified) -> Html:
    figures = [
        element(
            "figure",
            element("img", src=svg_uri(_curve(found, j)), alt=f"{joint} over time"),
            element("figcaption", text(joint)),
        )
        for j, joint in enumerate(JOINTS)
    ]
    return joined((element("div", *figures, class_="pair"), paragraph(_NOTE, class_="note")))


def _curve(found: Identified, j: int) -> str:
    check = found.held_out

    def draw(figure: Any, axes: Any) -> None:
        del figure
        for words, angles, colour, line in (
            ("measured", check.measured, GREY, "-"),
            ("identified", check.identified, BLUE, "-"),
            ("nominal", check.nominal, ORANGE, "--"),
        ):
            width = 1.0 if words == "measured" else 1.8
            axes.plot(
                check.t, np.degrees(angles[:, j]), line, color=colour, label=words, linewidth=width
            )
        axes.set_xlabel("s")
        axes.set_ylabel("degrees")
        if j == 0:
            axes.legend()

    return drawn(_SIZE_IN, draw)


def _table(found: Identified) -> Html:
    rows = [
        (
            text(label(e)),
            text(number(e, e.value)),
            element("strong", text(interval(e))) if e.differs else text(interval(e)),
            text(number(e, e.nominal)),
        )
        for e in found.estimates
    ]
    header = ("Parameter", "Identified", "95 % interval", "Nominal")
    return joined(
        (table(f"{len(rows)} parameters", header, rows), paragraph(_INTERVALS, class_="note"))
    )


def _untold(found: Identified) -> Html:
    return pairs((name, text(why)) for name, why in found.untold)
