"""Style and rendering of charts as SVG text; equal numbers give equal bytes."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Final

from shapechanger.errors import needing_extra

with needing_extra("report"):
    import matplotlib.style
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Palette of Okabe & Ito (2008), distinguishable with any colour vision. The green is darker than in
# the palette, so that thin lines are visible on white. Purple, dark yellow and grey are additions.
BLUE: Final = "#0072B2"
ORANGE: Final = "#D55E00"
GREEN: Final = "#007A5A"
PINK: Final = "#CC79A7"
PURPLE: Final = "#4B2A84"
SKY: Final = "#56B4E9"
YELLOW: Final = "#C79A00"
BLACK: Final = "#000000"
GREY: Final = "#555555"

_STYLE: Final = {
    "font.size": 10.0,
    "font.family": "DejaVu Sans",  # Ships with matplotlib, so charts do not depend on the machine.
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "shapechanger",
}
_NO_METADATA: Final = {"Date": None, "Creator": None, "Format": None, "Type": None}

# Sizes of charts, inches. Two panels fit next to each other on a page, and one fits on a phone.
PANEL: Final = (4.7, 4.1)
LOW_PANEL: Final = (4.7, 2.6)
SQUARE: Final = (4.4, 4.0)
WIDE: Final = (8.0, 3.6)


def svg_chart(size_in: tuple[float, float], draw: Callable[[Figure, Axes], None]) -> str:
    """Render one set of axes, `size_in` (width, height) inches, as SVG text."""
    with matplotlib.style.context(["default", _STYLE]):
        figure = Figure(figsize=size_in, layout="constrained")
        draw(figure, figure.add_subplot())
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=_NO_METADATA)
    return text.getvalue()
