"""Numbers of a finger in units that people read."""

from __future__ import annotations

import math
from typing import Final

from shapechanger.identify.identified import Estimate, Identified

__all__ = ["interval", "label", "number", "told"]

# The unit that is shown, and how many of it one of the SI unit is.
_SHOWN: Final = {
    "m": ("mm", 1e3),
    "s": ("ms", 1e3),
    "N/m": ("N/mm", 1e-3),
    "N·m/rad": ("mN·m/rad", 1e3),
    "N·m·s/rad": ("mN·m·s/rad", 1e3),
    "N": ("N", 1.0),
    "1": ("of nominal", 1.0),
}
# m. Arms below it turn a joint too little to matter by how much.
_SMALL_ARM_M: Final = 2e-3


def label(estimate: Estimate) -> str:
    """What it is, with its unit: `moment arm FDP, MCP_flexion [mm]`."""
    name, *of = estimate.name.split("/")
    words = {"moment_arms": "moment arm"}.get(name, name.replace("_", " "))
    return f"{words} {', '.join(of)}".strip() + f" [{_SHOWN[estimate.unit][0]}]"


def number(estimate: Estimate, value: float) -> str:
    """One of its numbers, in the unit that its label names."""
    if math.isinf(value):
        return "stiff"
    return f"{_SHOWN[estimate.unit][1] * value:.3g}"


def interval(estimate: Estimate) -> str:
    """Its 95 % interval."""
    return f"{number(estimate, estimate.low)} to {number(estimate, estimate.high)}"


def told(found: Identified) -> str:
    """What came out, in one line."""
    large = [e for e in found.arms if abs(e.value) > _SMALL_ARM_M]
    widest = max((0.5 * (e.high - e.low) / abs(e.value) for e in large), default=0.0)
    other = sum(e.differs for e in found.arms)
    off, nominal = (math.degrees(rms) for rms in found.held_out.off)
    return (
        f"arms: {len(found.arms)} intervals, the widest of those above 2 mm ±{widest:.1%}, "
        f"{other} leave out the nominal arm; held-out angles are off by "
        f"{off:.1f} degrees, in the nominal finger by {nominal:.1f}"
    )
