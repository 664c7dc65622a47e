"""Charts with axes as SVG text, byte for byte the same for the same numbers."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra
from shapechanger.reports.numbers import t_interval
from shapechanger.transfer.methods import load_method

try:
    import matplotlib.style
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter, FuncFormatter, MaxNLocator
except ImportError as error:
    raise MissingExtra("matplotlib", "report") from error

if TYPE_CHECKING:
    from shapechanger.demos.cloning.judge import Bin, Judgement
    from shapechanger.demos.cloning.learn import Training
    from shapechanger.identify.result import IdentifiedFinger
    from shapechanger.transfer.study import Study

# Okabe & Ito (2008), distinguishable with any colour vision; the green is darker than theirs, so
# that a thin line of it is visible on white. Purple, the dark yellow and grey are not theirs.
_BLUE: Final = "#0072B2"
_ORANGE: Final = "#D55E00"
_GREEN: Final = "#007A5A"
_PINK: Final = "#CC79A7"
_PURPLE: Final = "#4B2A84"
_SKY: Final = "#56B4E9"
_YELLOW: Final = "#C79A00"
_BLACK: Final = "#000000"
_GREY: Final = "#555555"
_MEMBER_COLOURS: Final = (_BLUE, _ORANGE, _GREEN, _PINK, _GREY)

_STYLE: Final = {
    "font.size": 10.0,
    "font.family": "DejaVu Sans",  # Ships with matplotlib, so that all machines draw the same.
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "shapechanger",
}
_NO_METADATA: Final = {"Date": None, "Creator": None, "Format": None, "Type": None}

# An interval of two seeds may reach ten times as far as they lie apart.
_BAND_SEEDS: Final = 3
# Two panels fit side by side on a page and one on a phone, at legible sizes. Inches.
_PANEL: Final = (4.7, 4.1)
_LOW_PANEL: Final = (4.7, 2.6)
_SQUARE: Final = (4.4, 4.0)
_WIDE: Final = (8.0, 3.6)

Counting = Literal["target", "total"]


class _LineStyle(NamedTuple):
    """Style of the curves of one kind; no two kinds differ by colour alone."""

    colour: str
    line: str | tuple[int, tuple[int, ...]]
    marker: str


_LINE_STYLES: Final[dict[str, _LineStyle]] = {
    "scratch": _LineStyle(_BLUE, "-", "o"),
    "fine-tune": _LineStyle(_ORANGE, "-", "s"),
    "zero-shot": _LineStyle(_GREEN, "--", ""),
    "randomised": _LineStyle(_PINK, "-.", ""),
    "identified": _LineStyle(_PURPLE, (0, (6, 2)), ""),
    "frozen-trunk": _LineStyle(_SKY, "-.", "^"),
    "rehearsal": _LineStyle(_SKY, "-", "P"),
    "kickstart": _LineStyle(_YELLOW, "-", "v"),
    "evolution": _LineStyle(_BLACK, "-", "d"),
    "generalist": _LineStyle(_PURPLE, "-", "*"),
    "random": _LineStyle(_GREY, ":", ""),
}


# Those of methods that are not shipped, in their order in the study.
_OTHER_STYLES: Final = (
    _LineStyle(_YELLOW, (0, (1, 1)), "D"),
    _LineStyle(_BLACK, (0, (4, 1, 1, 1)), "P"),
    _LineStyle(_SKY, (0, (3, 1)), "X"),
)


def _line_style(study: Study, kind: str) -> _LineStyle:
    """Return the style of a kind of run."""
    if kind in _LINE_STYLES:
        return _LINE_STYLES[kind]
    others = [arm for arm in study.plan.arms if arm not in _LINE_STYLES]
    return _OTHER_STYLES[others.index(kind) % len(_OTHER_STYLES)]


def learning_curves(study: Study, counting: Counting) -> str:
    """Plot the learning curves of a study.

    A thin line is one seed, a thick one the mean over seeds, a band its 95 % t-interval over seeds;
    of fewer than three seeds each evaluation is a point, because an interval of two says nothing. A
    horizontal level is a policy that is not trained on the target. Both ways of counting share the
    limits of the y axis.

    Args:
        study: The study.
        counting: "target" counts target steps; "total" shifts the arms that start from the source
            to the right by its source steps.
    """

    def draw(figure: Figure, axes: Axes) -> None:
        _draw_arms(axes, study, float(study.plan.source_steps) if counting == "total" else 0.0)
        axes.set_xlabel("Target steps" if counting == "target" else "Source and target steps")
        axes.set_ylabel(_axis_label(study))
        axes.set_ylim(*_return_limits(study))
        axes.xaxis.set_major_formatter(EngFormatter(sep="\N{THIN SPACE}"))
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_formatter(FuncFormatter(_tick_label))
        figure.legend(loc="outside lower center", ncols=2, handlelength=2.5)

    return _svg(_PANEL, draw)


def calibration_chart(bins: tuple[Bin, ...]) -> str:
    """Plot accuracy over confidence; each point is labelled with its number of steps."""

    def draw(_: Figure, axes: Axes) -> None:
        axes.plot([0, 1], [0, 1], color="#777777", linestyle="--", linewidth=1.0)
        sure, right = [b.sure for b in bins], [b.right for b in bins]
        axes.plot(sure, right, color=_BLUE, marker="o", linewidth=1.5)
        for one in bins:
            axes.annotate(
                str(one.steps), (one.sure, one.right), (4, -12), textcoords="offset points"
            )
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1.05)
        axes.set_xlabel("confidence")
        axes.set_ylabel("accuracy")

    return _svg(_SQUARE, draw)


def scatter_chart(judgement: Judgement, place: int) -> str:
    """Plot one number of each action: the policy's over the driver's.

    Args:
        judgement: The evaluation of a clone.
        place: Index of the number in an action.
    """

    def draw(_: Figure, axes: Axes) -> None:
        wanted = [row[place] for row in judgement.wanted]
        done = [row[place] for row in judgement.done]
        low, high = min(*wanted, *done), max(*wanted, *done)
        axes.plot([low, high], [low, high], color="#777777", linestyle="--", linewidth=1.0)
        axes.scatter(wanted, done, s=9, alpha=0.35, color=_BLUE, linewidths=0, rasterized=True)
        axes.set_xlabel("driver")
        axes.set_ylabel("policy")

    return _svg(_SQUARE, draw)


def training_chart(training: Training) -> str:
    """Plot the training loss (dashed) and the held-out loss (solid) of each network."""

    def draw(_: Figure, axes: Axes) -> None:
        members = sorted({check.member for check in training.checks})
        for member in members:
            colour = _MEMBER_COLOURS[member % len(_MEMBER_COLOURS)]
            own = [check for check in training.checks if check.member == member]
            steps = [check.step for check in own]
            axes.plot(steps, [c.loss for c in own], color=colour, linestyle="--", linewidth=0.9)
            axes.plot(steps, [c.error for c in own], color=colour, linewidth=1.6)
            for check in own:
                if check.step == training.best_steps[member]:
                    axes.plot([check.step], [check.error], color=colour, marker="o")
        axes.set_xlabel("steps of training")
        axes.set_ylabel("loss")

    return _svg(_WIDE, draw)


def joint_chart(found: IdentifiedFinger, joint: int) -> str:
    """Plot a joint's measured and simulated angles over the held-out part of a log.

    Args:
        found: The identified finger.
        joint: Index of the joint. The first one's chart has the legend.
    """
    check = found.held_out

    def draw(_: Figure, axes: Axes) -> None:
        for label, angles, colour, line, width in (
            ("measured", check.measured, _GREY, "-", 1.0),
            ("identified", check.identified, _BLUE, "-", 1.8),
            ("nominal", check.nominal, _ORANGE, "--", 1.8),
        ):
            degrees = np.degrees(angles[:, joint])
            axes.plot(check.t, degrees, line, color=colour, label=label, linewidth=width)
        axes.set_xlabel("s")
        axes.set_ylabel("degrees")
        if joint == 0:
            axes.legend()

    return _svg(_LOW_PANEL, draw)


def arms_chart(found: IdentifiedFinger) -> str:
    """Plot the moment arms with their 95 % intervals beside the nominal ones, joint by joint.

    Args:
        found: The identified finger.
    """

    def draw(figure: Figure, axes: Axes) -> None:
        axes.remove()
        tendons = list(dict.fromkeys(e.name.split("/")[1] for e in found.arms))
        joints = list(dict.fromkeys(e.name.split("/")[2] for e in found.arms))
        panels = figure.subplots(1, len(joints), sharey=True)
        for panel, joint in zip(panels, joints, strict=True):
            for e in found.arms:
                _, tendon, own = e.name.split("/")
                if own != joint:
                    continue
                row = tendons.index(tendon)
                first = row == 0
                ends = [1e3 * e.low, 1e3 * e.high]
                label = "identified, 95 % interval" if first else None
                panel.plot(ends, [row, row], color=_BLUE, linewidth=5.0, alpha=0.4)
                panel.plot([1e3 * e.value], [row], "o", color=_BLUE, markersize=4.5, label=label)
                panel.plot(
                    [1e3 * e.nominal],
                    [row],
                    "D",
                    markersize=8.0,
                    label="nominal" if first else None,
                    markerfacecolor="none",
                    markeredgecolor=_ORANGE,
                    markeredgewidth=1.4,
                )
            panel.axvline(0.0, color="#999999", linewidth=0.8)
            panel.set_title(joint.replace("_", " "), fontsize=10.0)
            panel.set_xlabel("mm")
            panel.margins(x=0.12)
        panels[0].set_yticks(range(len(tendons)), tendons)
        panels[0].invert_yaxis()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)

    return _svg(_WIDE, draw)


def _svg(size_in: tuple[float, float], draw: Callable[[Figure, Axes], None]) -> str:
    """Render one set of axes, `size_in` (width, height) inches, as SVG text."""
    with matplotlib.style.context(["default", _STYLE]):
        figure = Figure(figsize=size_in, layout="constrained")
        draw(figure, figure.add_subplot())
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=_NO_METADATA)
    return text.getvalue()


def _draw_arms(axes: Axes, study: Study, source_steps: float) -> None:
    """Draw all arms; those that start from the source begin at `source_steps`."""
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
    if curves.n_seeds >= _BAND_SEEDS:
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


def _axis_label(study: Study) -> str:
    """Return the name of the measure with its unit."""
    unit = "" if study.plan.unit == "1" else f", {study.plan.unit}"
    return f"{study.plan.measure.capitalize()} on the target{unit}"


def _return_limits(study: Study) -> tuple[float, float]:
    """Return limits of the y axis that contain every run; intervals are clipped."""
    returns: NDArray[np.float64] = np.concatenate(
        [study.curves(arm).returns.ravel() for arm in study.plan.arms]
        + [np.array([next(iter(study.summaries.values())).reference.zero])]
    )
    low, high = float(returns.min()), float(returns.max())
    margin = 0.15 * (high - low) or 0.1 * max(1.0, abs(high))
    return low - margin, high + margin


def _tick_label(value: float, place: int | None) -> str:
    """Format a tick; `place` is matplotlib's."""
    return f"{value:,.10g}".replace("e+", "e")


def sweep_chart(studies: Mapping[float, Study], xlabel: str) -> str:
    """Plot the end of each arm over a number in which the targets of several studies differ.

    A point is one seed; a line joins the means over seeds.

    Args:
        studies: The studies by that number.
        xlabel: What the number is.
    """
    first = next(iter(studies.values()))

    def draw(figure: Figure, axes: Axes) -> None:
        values = sorted(studies)
        for arm in first.plan.arms:
            style = _line_style(first, arm)
            ends = [_ends(studies[value], arm) for value in values]
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
        figure.legend(loc="outside lower center", ncols=3, handlelength=2.5)

    return _svg(_WIDE, draw)


def _ends(study: Study, arm: str) -> NDArray[np.float64]:
    """Return the mean of the last evaluations of each run of an arm."""
    returns = study.curves(arm).returns
    return returns[:, -min(study.plan.last_k, returns.shape[1]) :].mean(axis=1)
