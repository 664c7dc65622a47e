"""The report of an identified finger: its charts, and its numbers in readable units."""

# Matplotlib's stubs leave the type of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.identify.result import IdentifiedFinger, ParameterEstimate
from shapechanger.reports.charts import BLUE, GREY, LOW_PANEL, ORANGE, WIDE, svg_chart
from shapechanger.reports.page import render, svg_uri

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# For each SI unit the unit that is shown, and the factor between them.
_SHOWN: Final = {
    "m": ("mm", 1e3),
    "s": ("ms", 1e3),
    "N/m": ("N/mm", 1e-3),
    "N·m/rad": ("mN·m/rad", 1e3),
    "N·m·s/rad": ("mN·m·s/rad", 1e3),
    "N": ("N", 1.0),
    "1": ("of nominal", 1.0),
}
# Widest interval that counts as bounded, in SI units. It is the thickness of a finger for arms, and
# more than twice the range of the gap "wide" for the other parameters.
_WIDEST: Final = {
    "moment_arms": 0.015,
    "tendon_friction": 3.0,
    "tendon_stiffness": 60e3,
    "motor_lag": 0.05,
    "command_delay": 0.1,
    "strength": 0.6,
}
# Widest bounded interval of stiffness and damping of the joints, divided by the nominal value.
_WIDEST_OF_NOMINAL: Final = 3.0
_INTERVAL: Final = "identified, 95 % interval"
# Moment arm, m, below which the relative error hardly matters.
_SMALL_ARM_M: Final = 2e-3


def finger_html(found: IdentifiedFinger, name: str) -> str:
    """Render the report of a log with this name.

    Raises:
        MissingExtra: If matplotlib or Jinja2 is not installed.
    """
    return render(
        "finger.html",
        title=name,
        verdict=f"{summary_line(found).capitalize()}.",
        log=f"{found.seconds:.1f} s" + (f" of {found.source}" if found.source else ""),
        charts=[(joint, svg_uri(joint_chart(found, i))) for i, joint in enumerate(JOINTS)],
        arms=svg_uri(arms_chart(found)),
        arm_count=len(found.arms),
        rows=[
            {
                "label": label(e),
                "value": number(e, e.value),
                "interval": interval(e),
                "differs": e.differs,
                "nominal": number(e, e.nominal),
            }
            for e in found.estimates
            if e not in found.arms
        ],
        unknown=unknown(found),
        undetermined=found.undetermined,
    )


def label(estimate: ParameterEstimate) -> str:
    """Name of a parameter with its unit, such as `moment arm FDP, MCP_flexion [mm]`."""
    name, *of = estimate.name.split("/")
    text = {"moment_arms": "moment arm"}.get(name, name.replace("_", " "))
    return f"{text} {', '.join(of)}".strip() + f" [{_SHOWN[estimate.unit][0]}]"


def number(estimate: ParameterEstimate, value: float) -> str:
    """Format a value of a parameter, in its SI unit, in the unit of its label."""
    if math.isinf(value):
        return "stiff"
    return f"{_SHOWN[estimate.unit][1] * value:.3g}"


def interval(estimate: ParameterEstimate) -> str:
    """Format the 95 % interval of a parameter, or return "unknown" if it is unbounded."""
    low, high = number(estimate, estimate.low), number(estimate, estimate.high)
    return "unknown" if unbounded(estimate) else f"{low} to {high}"


def arm_cell(estimate: ParameterEstimate) -> str:
    """Format a moment arm with half its interval, mm; a star if the nominal arm is outside."""
    half, star = 0.5e3 * (estimate.high - estimate.low), "*" if estimate.differs else ""
    return "unknown" if unbounded(estimate) else f"{1e3 * estimate.value:.2f} ±{half:.2f}{star}"


def unbounded(estimate: ParameterEstimate) -> str:
    """Return why the log does not bound a parameter, or "" if the log bounds it."""
    unit, factor = _SHOWN[estimate.unit]
    low, high = (f"{factor * end:.3g}" for end in (estimate.low, estimate.high))
    if math.isinf(estimate.low):
        return "no stretch is visible, so every large value fits."
    if math.isinf(estimate.high):
        return f"the stretch is hardly visible, so every value above {low} {unit} fits."
    kind = estimate.name.split("/")[0]
    widest = _WIDEST.get(kind, _WIDEST_OF_NOMINAL * estimate.nominal)
    if estimate.high - estimate.low <= widest:
        return ""
    return (
        f"every value from {low} to {high} {unit} fits; a range wider than "
        f"{factor * widest:.3g} {unit} counts as unknown."
    )


def unknown(found: IdentifiedFinger) -> list[tuple[str, str]]:
    """Names of the parameters that the log does not bound, each with the reason."""
    pairs = ((e.name, unbounded(e)) for e in found.estimates)
    return [(name, why) for name, why in pairs if why]


def summary_line(found: IdentifiedFinger) -> str:
    """Summarise the result in one line."""
    large = [e for e in found.arms if abs(e.value) > _SMALL_ARM_M]
    widest = max((0.5 * (e.high - e.low) / abs(e.value) for e in large), default=0.0)
    other = sum(e.differs for e in found.arms)
    off, nominal = (math.degrees(rms) for rms in found.held_out.off)
    return (
        f"arms: {len(found.arms)} intervals, the widest of those above 2 mm ±{widest:.1%}, "
        f"{other} exclude the nominal arm; held-out angles are off by "
        f"{off:.1f} degrees, in the nominal finger by {nominal:.1f}"
    )


def joint_chart(found: IdentifiedFinger, joint: int) -> str:
    """Plot measured and simulated angles of a joint, by index, in the held-out part of a log."""
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
    """Plot the moment arms, their 95 % intervals and the nominal arms, joint by joint."""

    def draw(figure: Figure, axes: Axes) -> None:
        axes.remove()
        tendons = list(dict.fromkeys(e.name.split("/")[1] for e in found.arms))
        joints = list(dict.fromkeys(e.name.split("/")[2] for e in found.arms))
        panels = figure.subplots(1, len(joints), sharey=True)
        for panel, joint in zip(panels, joints, strict=True):
            own = [e for e in found.arms if e.name.endswith(f"/{joint}")]
            rows = [tendons.index(e.name.split("/")[1]) for e in own]
            lows, values, highs, nominal = (
                1e3 * np.array([getattr(e, name) for e in own])
                for name in ("low", "value", "high", "nominal")
            )
            panel.hlines(rows, lows, highs, color=BLUE, linewidth=5.0, alpha=0.4)
            panel.plot(values, rows, "o", color=BLUE, markersize=4.5, label=_INTERVAL)
            look = {"markerfacecolor": "none", "markeredgecolor": ORANGE, "markeredgewidth": 1.4}
            panel.plot(nominal, rows, "D", markersize=8.0, label="nominal", **look)
            panel.axvline(0.0, color="#999999", linewidth=0.8)
            panel.set_title(joint.replace("_", " "), fontsize=10.0)
            panel.set_xlabel("mm")
            panel.margins(x=0.12)
        panels[0].set_yticks(range(len(tendons)), tendons)
        panels[0].invert_yaxis()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)

    return svg_chart(WIDE, draw)
