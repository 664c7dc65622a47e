"""How fast each part of a path can be driven."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.pathfinder.path import Path
from shapechanger.worlds.pathfinder.traits import Traits

__all__ = ["pace"]


def pace(path: Path, traits: Traits) -> NDArray[np.float64]:
    """The speed to drive each point of a path at, m/s.

    Bends limit it by the acceleration across, narrow places by care, and both are seen early
    enough to slow down.

    Args:
        path: What is driven.
        traits: By what.

    Returns:
        (N,) one a point of the path.
    """
    least = traits.half_width_m + traits.margin_m
    comfort = traits.half_width_m + traits.comfort_m
    room = np.clip((path.clearance - least) / (comfort - least), 0.0, 1.0)
    speed = traits.top_speed * traits.cruise * (0.65 + 0.35 * room)
    bend = np.maximum(np.abs(path.curvature), 1e-6)
    speed = np.minimum(speed, np.sqrt(traits.lateral_limit / bend))
    step = path.length / len(speed)
    for i in range(2 * len(speed) - 1, -1, -1):  # Twice round, for the end is before the start.
        here, after = i % len(speed), (i + 1) % len(speed)
        can_brake_from = np.sqrt(speed[after] ** 2 + 2 * traits.braking * step)
        speed[here] = min(speed[here], can_brake_from)
    return speed
