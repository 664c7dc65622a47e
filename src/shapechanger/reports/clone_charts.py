"""Charts of the report of a clone."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from shapechanger.reports.charts import BLUE, GREEN, GREY, ORANGE, PINK, SQUARE, WIDE, svg_chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from shapechanger.demos.cloning.judge import Bin, Judgement
    from shapechanger.demos.cloning.learn import Training


_MEMBER_COLOURS: Final = (BLUE, ORANGE, GREEN, PINK, GREY)


def calibration_chart(bins: tuple[Bin, ...]) -> str:
    """Plot accuracy over confidence; each point is labelled with its number of steps."""

    def draw(_: Figure, axes: Axes) -> None:
        axes.plot([0, 1], [0, 1], color="#777777", linestyle="--", linewidth=1.0)
        sure, right = [b.sure for b in bins], [b.right for b in bins]
        axes.plot(sure, right, color=BLUE, marker="o", linewidth=1.5)
        for one in bins:
            axes.annotate(
                str(one.steps), (one.sure, one.right), (4, -12), textcoords="offset points"
            )
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1.05)
        axes.set_xlabel("confidence")
        axes.set_ylabel("accuracy")

    return svg_chart(SQUARE, draw)


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
        axes.scatter(wanted, done, s=9, alpha=0.35, color=BLUE, linewidths=0, rasterized=True)
        axes.set_xlabel("driver")
        axes.set_ylabel("policy")

    return svg_chart(SQUARE, draw)


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

    return svg_chart(WIDE, draw)
