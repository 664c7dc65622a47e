"""Charts of the report of an identified finger."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shapechanger.reports.charts import BLUE, GREY, LOW_PANEL, ORANGE, WIDE, svg_chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from shapechanger.finger.identify.result import IdentifiedFinger


def joint_chart(found: IdentifiedFinger, joint: int) -> str:
    """Plot a joint's measured and simulated angles over the held-out part of a log.

    Args:
        found: The identified finger.
        joint: Index of the joint. The first one's chart has the legend.
    """
    check = found.held_out

    def draw(_: Figure, axes: Axes) -> None:
        for label, angles, colour, line, width in (
            ("measured", check.measured, GREY, "-", 1.0),
            ("identified", check.identified, BLUE, "-", 1.8),
            ("nominal", check.nominal, ORANGE, "--", 1.8),
        ):
            degrees = np.degrees(angles[:, joint])
            axes.plot(check.t, degrees, line, color=colour, label=label, linewidth=width)
        axes.set_xlabel("s")
        axes.set_ylabel("degrees")
        if joint == 0:
            axes.legend()

    return svg_chart(LOW_PANEL, draw)


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
                panel.plot(ends, [row, row], color=BLUE, linewidth=5.0, alpha=0.4)
                panel.plot([1e3 * e.value], [row], "o", color=BLUE, markersize=4.5, label=label)
                panel.plot(
                    [1e3 * e.nominal],
                    [row],
                    "D",
                    markersize=8.0,
                    label="nominal" if first else None,
                    markerfacecolor="none",
                    markeredgecolor=ORANGE,
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

    return svg_chart(WIDE, draw)
