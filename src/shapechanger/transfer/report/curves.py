"""Charts of studies: learning curves and sweeps."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.reports import charts
from shapechanger.reports.numbers import t_interval
from shapechanger.transfer.methods import load_method
from shapechanger.transfer.report.verdict import LEAST_SEEDS, finals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from shapechanger.transfer.study import Study

# Most characters of a line of a legend, and the height that a chart has for its legend, inches.
_LABEL_LENGTH: Final = 40
_LEGEND_HEIGHT: Final = 0.7

Counting = Literal["target", "total"]


class _LineStyle(NamedTuple):
    """Style of the curves of one kind; no two kinds differ by colour alone."""

    colour: str
    line: str | tuple[int, tuple[int, ...]]
    marker: str


_LINE_STYLES: Final[dict[str, _LineStyle]] = {
    "scratch": _LineStyle(charts.BLUE, "-", "o"),
    "fine-tune": _LineStyle(charts.ORANGE, "-", "s"),
    "zero-shot": _LineStyle(charts.GREEN, "--", ""),
    "randomised": _LineStyle(charts.PINK, "-.", ""),
    "identified": _LineStyle(charts.PURPLE, (0, (6, 2)), ""),
    "frozen-trunk": _LineStyle(charts.SKY, "-.", "^"),
    "rehearsal": _LineStyle(charts.SKY, "-", "P"),
    "kickstart": _LineStyle(charts.YELLOW, "-", "v"),
    "evolution": _LineStyle(charts.BLACK, "-", "d"),
    "generalist": _LineStyle(charts.PURPLE, "-", "*"),
    "random": _LineStyle(charts.GREY, ":", ""),
}
# Styles of the other methods, in their order in the study; a fourth one has the first style again.
_OTHER_STYLES: Final = (
    _LineStyle(charts.YELLOW, (0, (1, 1)), "D"),
    _LineStyle(charts.BLACK, (0, (4, 1, 1, 1)), "P"),
    _LineStyle(charts.SKY, (0, (3, 1)), "X"),
)


def _line_style(study: Study, kind: str) -> _LineStyle:
    if kind in _LINE_STYLES:
        return _LINE_STYLES[kind]
    others = [arm for arm in study.plan.arms if arm not in _LINE_STYLES]
    return _OTHER_STYLES[others.index(kind) % len(_OTHER_STYLES)]


def learning_curves(study: Study, *countings: Counting) -> dict[Counting, str]:
    """Plot the learning curves of a study, once for each way of counting.

    A thin line is one seed, a thick line the mean over seeds, and a band its 95 % t-interval. With
    fewer than three seeds, points replace the band, because an interval of two seeds is too wide to
    be useful. A horizontal line is a policy that is not trained on the target. All charts share the
    limits of the y axis.
    """
    # Imported here, because `charts` reports the extra that is missing.
    from matplotlib.ticker import EngFormatter, FuncFormatter, MaxNLocator

    # The y axis shows every run; intervals are clipped.
    returns: NDArray[np.float64] = np.concatenate(
        [study.curves(arm).returns.ravel() for arm in study.plan.arms]
        + [np.array([next(iter(study.summaries.values())).reference.zero])]
    )
    low, high = float(returns.min()), float(returns.max())
    margin = 0.15 * (high - low) or 0.1 * max(1.0, abs(high))

    def tick(value: float, place: int | None) -> str:
        return f"{value:,.10g}".replace("e+", "e")

    def draw(figure: Figure, axes: Axes, counting: Counting) -> None:
        _draw_arms(axes, study, float(study.plan.source_steps) if counting == "total" else 0.0)
        axes.set_xlabel("Target steps" if counting == "target" else "Source and target steps")
        axes.set_ylabel(_axis_label(study))
        axes.set_ylim(low - margin, high + margin)
        axes.xaxis.set_major_formatter(EngFormatter(sep="\N{THIN SPACE}"))
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_formatter(FuncFormatter(tick))
        _add_legend(figure, columns=2)

    return {
        each: charts.svg_chart(charts.PANEL, partial(draw, counting=each)) for each in countings
    }


def _draw_arms(axes: Axes, study: Study, source_steps: float) -> None:
    last = float(study.plan.steps)
    reference = next(iter(study.summaries.values())).reference
    style = _LINE_STYLES["random"]
    axes.axhline(
        reference.zero,
        color=style.colour,
        linestyle=style.line,
        label=f"no skill: {reference.zero_of}",
    )
    if source_steps:
        axes.axvline(source_steps, color="#999999", linewidth=0.8)
        axes.text(
            source_steps,
            0.99,
            " source ends ",
            color="#555555",
            fontsize=9.0,
            va="top",
            ha="left" if source_steps < last else "right",
            transform=axes.get_xaxis_transform(),
        )
    for arm in study.plan.arms:
        _draw_arm(axes, study, arm, source_steps)


def _draw_arm(axes: Axes, study: Study, arm: str, source_steps: float) -> None:
    """Draw an arm as curves, or as a level if it is not trained on the target."""
    method, style, curves = load_method(arm), _line_style(study, arm), study.curves(arm)
    start = source_steps if method.uses_source else 0.0
    is_level = not method.learns_on_target
    steps, returns = curves.steps + start, curves.returns
    if is_level:
        steps = np.array([start, start + study.plan.steps])
        returns = np.repeat(returns[:, :1], 2, axis=1)
    else:
        axes.plot(steps, returns.T, color=style.colour, linewidth=0.7, alpha=0.45)
    spread = t_interval(returns)
    if curves.n_seeds >= LEAST_SEEDS:
        shade = 0.12 if is_level else 0.18
        axes.fill_between(
            steps, spread.low, spread.high, color=style.colour, alpha=shade, linewidth=0.0
        )
    elif is_level:
        axes.plot([start] * curves.n_seeds, returns[:, 0], "o", color=style.colour, markersize=3.5)
    else:
        axes.plot(steps, returns.T, style.marker, color=style.colour, markersize=2.5)
    axes.plot(
        steps,
        spread.mean,
        color=style.colour,
        linestyle=style.line,
        linewidth=1.8 if is_level else 2.2,
        marker="" if is_level else style.marker,
        markersize=4.5,
        markevery=max(1, curves.n_evals // 8),
        label=f"{arm}, {curves.n_seeds} seeds",
    )


def _add_legend(figure: Figure, columns: int) -> None:
    """Add a legend below the axes, in one column if it is too wide; the figure grows with it."""
    handles, labels = figure.axes[0].get_legend_handles_labels()
    texts = [fill(label, _LABEL_LENGTH) for label in labels]
    place = partial(figure.legend, handles, texts, loc="outside lower center", handlelength=2.5)
    legend = place(ncols=columns)
    if legend.get_window_extent().width > 0.97 * figure.bbox.width:
        legend.remove()
        legend = place(ncols=1)
    more = legend.get_window_extent().height / figure.dpi - _LEGEND_HEIGHT
    figure.set_figheight(figure.get_figheight() + max(0.0, more))


def _axis_label(study: Study) -> str:
    unit = "" if study.plan.unit == "1" else f", {study.plan.unit}"
    return f"{study.plan.measure.capitalize()} on the target{unit}"


def sweep_chart(studies: Mapping[float, Study], xlabel: str) -> str:
    """Plot the final value of each arm against a property of the target, named `xlabel`.

    The studies are keyed by its value. A point is one seed; a line joins the means over seeds.
    """
    first = next(iter(studies.values()))

    def draw(figure: Figure, axes: Axes) -> None:
        values = sorted(studies)
        for arm in first.plan.arms:
            style = _line_style(first, arm)
            ends = [finals(studies[value], arm) for value in values]
            for value, end in zip(values, ends, strict=True):
                axes.plot([value] * end.size, end, ".", color=style.colour, alpha=0.4, markersize=4)
            axes.plot(
                values,
                [float(end.mean()) for end in ends],
                color=style.colour,
                linestyle=style.line,
                marker=style.marker or "o",
                markersize=4.5,
                linewidth=2.0,
                label=arm,
            )
        axes.set_xlabel(xlabel)
        axes.set_ylabel(_axis_label(first))
        _add_legend(figure, columns=3)

    return charts.svg_chart(charts.WIDE, draw)
