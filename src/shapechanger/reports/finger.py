"""Numbers of a finger in units that people read."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from shapechanger.bodies.finger import JOINTS
from shapechanger.identify.result import IdentifiedFinger, ParameterEstimate
from shapechanger.reports.charts import BLUE, GREY, ORANGE, draw_svg
from shapechanger.reports.page import (
    Html,
    element,
    joined,
    page_text,
    pairs,
    paragraph,
    svg_uri,
    table,
    text,
)

__all__ = ["finger_html", "interval", "label", "number", "summary_line"]

# The unit that is shown, and how many of it one of the SI unit is.
_SHOWN: Final = {
    "m": ("mm", 1e3),
    "s": ("ms", 1e3),
    "N/m": ("N/mm", 1e-3),
    "N·m/rad": ("mN·m/rad", 1e3),
    "N·m·s/rad": ("mN·m·s/rad", 1e3),
    "N": ("N", 1.0),
    "1": ("of nominal", 1.0),
}
# m. Arms below it turn a joint too little to matter by how much.
_SMALL_ARM_M: Final = 2e-3


def label(estimate: ParameterEstimate) -> str:
    """What it is, with its unit: `moment arm FDP, MCP_flexion [mm]`."""
    name, *of = estimate.name.split("/")
    words = {"moment_arms": "moment arm"}.get(name, name.replace("_", " "))
    return f"{words} {', '.join(of)}".strip() + f" [{_SHOWN[estimate.unit][0]}]"


def number(estimate: ParameterEstimate, value: float) -> str:
    """One of its numbers, in the unit that its label names."""
    if math.isinf(value):
        return "stiff"
    return f"{_SHOWN[estimate.unit][1] * value:.3g}"


def interval(estimate: ParameterEstimate) -> str:
    """Its 95 % interval."""
    return f"{number(estimate, estimate.low)} to {number(estimate, estimate.high)}"


def summary_line(found: IdentifiedFinger) -> str:
    """What came out, in one line."""
    large = [e for e in found.arms if abs(e.value) > _SMALL_ARM_M]
    widest = max((0.5 * (e.high - e.low) / abs(e.value) for e in large), default=0.0)
    other = sum(e.differs for e in found.arms)
    off, nominal = (math.degrees(rms) for rms in found.held_out.off)
    return (
        f"arms: {len(found.arms)} intervals, the widest of those above 2 mm ±{widest:.1%}, "
        f"{other} leave out the nominal arm; held-out angles are off by "
        f"{off:.1f} degrees, in the nominal finger by {nominal:.1f}"
    )


# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false


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


def finger_html(found: IdentifiedFinger, name: str) -> str:
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
                paragraph(summary_line(found).capitalize() + ".", class_="verdict"),
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


def _curves(found: IdentifiedFinger) -> Html:
    figures = [
        element(
            "figure",
            element("img", src=svg_uri(_curve(found, j)), alt=f"{joint} over time"),
            element("figcaption", text(joint)),
        )
        for j, joint in enumerate(JOINTS)
    ]
    return joined((element("div", *figures, class_="pair"), paragraph(_NOTE, class_="note")))


def _curve(found: IdentifiedFinger, j: int) -> str:
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

    return draw_svg(_SIZE_IN, draw)


def _table(found: IdentifiedFinger) -> Html:
    rows = [
        (
            text(label(e)),
            text(number(e, e.value)),
            element("strong", text(interval(e))) if e.differs else text(interval(e)),
            text(number(e, e.nominal)),
        )
        for e in found.estimates
    ]
    header = ("Parameter", "IdentifiedFinger", "95 % interval", "Nominal")
    return joined(
        (table(f"{len(rows)} parameters", header, rows), paragraph(_INTERVALS, class_="note"))
    )


def _untold(found: IdentifiedFinger) -> Html:
    return pairs((name, text(why)) for name, why in found.untold)
