"""The drawings in the report of a cloned policy, as SVG text."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from shapechanger.demos.cloning.judge import Bin, Judgement
from shapechanger.demos.cloning.learn import Training
from shapechanger.pages.drawing import BLUE, GREEN, GREY, ORANGE, PINK, drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["calibration", "learning", "points"]

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

    return drawn(_SQUARE_IN, draw)


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

    return drawn(_SQUARE_IN, draw)


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

    return drawn(_WIDE_IN, draw)
