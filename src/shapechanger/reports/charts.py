"""A drawing with axes, as SVG text: the same for the same numbers, on every machine."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.judge import Bin, Judgement
from shapechanger.demos.cloning.learn import Training
from shapechanger.errors import MissingExtra
from shapechanger.reports.numbers import t_interval
from shapechanger.transfer.plan import ADAPTED_SOURCE_ARMS, RunKind
from shapechanger.transfer.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "BLUE",
    "GREEN",
    "GREY",
    "ORANGE",
    "PINK",
    "PURPLE",
    "Counting",
    "calibration",
    "draw_svg",
    "learning",
    "learning_curves",
    "points",
]

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false


try:
    import matplotlib.style
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtra("matplotlib", "report") from error


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


def draw_svg(size_in: tuple[float, float], draw: Callable[[Figure, Axes], None]) -> str:
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


# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false


try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter, FuncFormatter, MaxNLocator
except ImportError as error:
    raise MissingExtra("matplotlib", "report") from error


Counting = Literal["target", "total"]


class _Look(NamedTuple):
    """How the curves of one kind are drawn; no two kinds differ by colour alone."""

    colour: str
    line: str | tuple[int, tuple[int, ...]]
    marker: str


_LOOKS: Final[dict[RunKind, _Look]] = {
    "scratch": _Look(BLUE, "-", "o"),
    "fine-tune": _Look(ORANGE, "-", "s"),
    "zero-shot": _Look(GREEN, "--", ""),
    "randomised": _Look(PINK, "-.", ""),
    "identified": _Look(PURPLE, (0, (6, 2)), ""),
    "random": _Look(GREY, ":", ""),
}
# Two panels side by side fill a page, and one below the other a telephone, at sizes one can read.
_SIZE_IN: Final = (4.7, 4.1)


def learning_curves(study: Study, counting: Counting) -> str:
    """One panel as SVG text, the same for the same study.

    A thin line is one seed, a thick one the mean over seeds, a band its 95 % t-interval over seeds;
    a level is that of a policy that is not trained on the target. Both panels share the height of
    their axes.

    Args:
        study: The study.
        counting: "target" counts target steps; "total" moves what comes from the source to the
            right by its source steps.
    """

    def draw(figure: Figure, axes: Axes) -> None:
        _draw(axes, study, float(study.plan.source_steps) if counting == "total" else 0.0)
        axes.set_xlabel("Target steps" if counting == "target" else "Source and target steps")
        axes.set_ylabel("Mean return on the target")
        axes.set_ylim(*_heights(study))
        axes.xaxis.set_major_formatter(EngFormatter(sep="\N{THIN SPACE}"))
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_formatter(FuncFormatter(_return_text))
        figure.legend(loc="outside lower center", ncols=2, handlelength=2.5)

    return draw_svg(_SIZE_IN, draw)


def _draw(axes: Axes, study: Study, source_steps: float) -> None:
    """Draw all curves, those of the transfer arms from `source_steps` on."""
    last = float(study.plan.steps)
    _level(axes, study, "random", 0.0, source_steps + last)
    if source_steps:
        axes.axvline(source_steps, color="#999999", linewidth=0.8)
        early = source_steps < last
        axes.text(
            source_steps,
            0.99,
            " source ends ",
            color="#555555",
            fontsize=9.0,
            va="top",
            ha="left" if early else "right",
            transform=axes.get_xaxis_transform(),
        )
    for arm in study.plan.arms:
        start = 0.0 if arm == "scratch" else source_steps
        if arm == "zero-shot" or arm in ADAPTED_SOURCE_ARMS:
            _level(axes, study, arm, start, start + last)
        else:
            _curve(axes, study, arm, start)


def _curve(axes: Axes, study: Study, kind: RunKind, start: float) -> None:
    """The curves of an arm that is trained on the target."""
    look, curves = _LOOKS[kind], study.curves(kind)
    steps = curves.steps + start
    spread = t_interval(curves.returns)
    axes.plot(steps, curves.returns.T, color=look.colour, linewidth=0.7, alpha=0.45)
    axes.fill_between(steps, spread.low, spread.high, color=look.colour, alpha=0.18, linewidth=0.0)
    axes.plot(
        steps,
        spread.mean,
        color=look.colour,
        linestyle=look.line,
        linewidth=2.2,
        marker=look.marker,
        markersize=4.5,
        markevery=max(1, curves.n_evals // 8),
        label=f"{kind}, {curves.n_seeds} seeds",
    )


def _level(axes: Axes, study: Study, kind: RunKind, start: float, end: float) -> None:
    """The level of a policy that is not trained on the target, with its interval."""
    look, returns = _LOOKS[kind], study.curves(kind).returns[:, :1]
    spread = t_interval(returns)
    axes.fill_between(
        [start, end], spread.low[0], spread.high[0], color=look.colour, alpha=0.12, linewidth=0.0
    )
    axes.plot(
        [start, end],
        np.repeat(spread.mean, 2),
        color=look.colour,
        linestyle=look.line,
        linewidth=1.8,
        label="random policy" if kind == "random" else f"{kind}, {returns.size} seeds",
    )


def _heights(study: Study) -> tuple[float, float]:
    """Lower and upper end of the axis: every run is in it, and at least the means' own spread.

    An interval of two seeds may reach ten times as far as its runs do, so intervals are cut off.
    """
    kinds: list[RunKind] = ["random", *study.plan.arms]
    returns: NDArray[np.float64] = np.concatenate(
        [study.curves(kind).returns.ravel() for kind in kinds]
    )
    low, high = float(returns.min()), float(returns.max())
    margin = 0.15 * (high - low) or 0.1 * max(1.0, abs(high))
    return low - margin, high + margin


def _return_text(value: float, place: int | None) -> str:
    """The label of a tick; `place` is matplotlib's."""
    return f"{value:,.10g}".replace("e+", "e")


# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false


_COLOURS: Final = (BLUE, ORANGE, GREEN, PINK, GREY)
_SQUARE_IN: Final = (4.4, 4.0)
_WIDE_IN: Final = (8.0, 3.6)


def calibration(bins: tuple[Bin, ...]) -> str:
    """How often the policy was right, over how sure it was; the numbers count steps."""

    def draw(_: Figure, axes: Axes) -> None:
        axes.plot([0, 1], [0, 1], color="#777777", linestyle="--", linewidth=1.0)
        sure, right = [b.sure for b in bins], [b.right for b in bins]
        axes.plot(sure, right, color=_COLOURS[0], marker="o", linewidth=1.5)
        for one in bins:
            axes.annotate(
                str(one.steps), (one.sure, one.right), (4, -12), textcoords="offset points"
            )
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1.05)
        axes.set_xlabel("how sure it was")
        axes.set_ylabel("how often it was right")

    return draw_svg(_SQUARE_IN, draw)


def points(judgement: Judgement, place: int) -> str:
    """One number of each action: what the policy did over what the driver did."""

    def draw(_: Figure, axes: Axes) -> None:
        wanted = [row[place] for row in judgement.wanted]
        done = [row[place] for row in judgement.done]
        low, high = min(*wanted, *done), max(*wanted, *done)
        axes.plot([low, high], [low, high], color="#777777", linestyle="--", linewidth=1.0)
        axes.scatter(
            wanted, done, s=9, alpha=0.35, color=_COLOURS[0], linewidths=0, rasterized=True
        )
        axes.set_xlabel("driver")
        axes.set_ylabel("policy")

    return draw_svg(_SQUARE_IN, draw)


def learning(training: Training) -> str:
    """Both losses of every network over its steps."""

    def draw(_: Figure, axes: Axes) -> None:
        members = sorted({check.member for check in training.checks})
        for member in members:
            colour = _COLOURS[member % len(_COLOURS)]
            own = [check for check in training.checks if check.member == member]
            steps = [check.step for check in own]
            axes.plot(steps, [c.loss for c in own], color=colour, linestyle="--", linewidth=0.9)
            axes.plot(steps, [c.error for c in own], color=colour, linewidth=1.6)
            for check in own:
                if check.step == training.steps[member]:
                    axes.plot([check.step], [check.error], color=colour, marker="o")
        axes.set_xlabel("steps of training")
        axes.set_ylabel("loss")

    return draw_svg(_WIDE_IN, draw)
