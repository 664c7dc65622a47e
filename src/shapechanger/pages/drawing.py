"""A drawing with axes, as SVG text: the same for the same numbers, on every machine."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Final

from shapechanger.errors import MissingExtra

try:
    import matplotlib.style
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtra("matplotlib", "report") from error

__all__ = ["BLUE", "GREEN", "GREY", "ORANGE", "PINK", "PURPLE", "drawn"]

# Colours of Okabe & Ito (2008), which people tell apart however they see colours; the green is
# darker than theirs, so that a thin line of it can be seen on white.
BLUE: Final = "#0072B2"
ORANGE: Final = "#D55E00"
GREEN: Final = "#007A5A"
PINK: Final = "#CC79A7"
# Not theirs; darker than all of them but black.
PURPLE: Final = "#4B2A84"
GREY: Final = "#555555"

_STYLE: Final = {
    "font.size": 10.0,
    "font.family": "DejaVu Sans",  # Comes with matplotlib, so that all machines draw the same.
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "shapechanger",
}
_NO_METADATA: Final = {"Date": None, "Creator": None, "Format": None, "Type": None}


def drawn(size_in: tuple[float, float], draw: Callable[[Figure, Axes], None]) -> str:
    """A drawing as SVG text.

    Args:
        size_in: Width and height in inches.
        draw: Draws on the axes, and writes around them on the figure.
    """
    with matplotlib.style.context(["default", _STYLE]):
        figure = Figure(figsize=size_in, layout="constrained")
        draw(figure, figure.add_subplot())
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=_NO_METADATA)
    return text.getvalue()
