"""Learning curves on the target as a picture: every seed, the mean, and how sure it is."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra
from shapechanger.pages.drawing import BLUE, GREEN, GREY, ORANGE, PINK, PURPLE, drawn
from shapechanger.transfer.plan import LIKENED, RunKind
from shapechanger.transfer.report.spread import t_interval
from shapechanger.transfer.study import Study

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter, FuncFormatter, MaxNLocator
except ImportError as error:
    raise MissingExtra("matplotlib", "report") from error

__all__ = ["Counting", "learning_curves"]

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

    return drawn(_SIZE_IN, draw)


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
        if arm == "zero-shot" or arm in LIKENED:
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
