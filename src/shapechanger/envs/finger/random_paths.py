"""Paths to learn on: another shape, place, size and pace each time."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger.anatomy import PHALANX_LENGTH_M
from shapechanger.envs.finger.postures import draw_posture
from shapechanger.envs.finger.reachable import beginning_if_reachable
from shapechanger.tasks.finger import fingertip
from shapechanger.tasks.paths import Path, circle, figure_eight, line

__all__ = ["draw_path"]

# m, and m/s: up to a circle of 15 mm, and up to the speed of one of 12 mm once a second.
_SIZE: Final = (0.003, 0.015)
_SPEED: Final = (0.01, 0.08)
_SLOWEST_HZ: Final = 0.1
_FASTEST_HZ: Final = 2.0
# Points of a path at which it is checked.
_LOOKS: Final = 32


def draw_path(rng: np.random.Generator) -> tuple[Path, NDArray[np.float64]]:
    """A circle, an eight or a line that the finger can follow, and angles that begin it, rad."""
    while True:
        centre = fingertip(draw_posture(rng), PHALANX_LENGTH_M)
        size = rng.uniform(*_SIZE)
        hz = rng.uniform(*_SPEED) / (2.0 * math.pi * size)
        hz = min(max(hz, _SLOWEST_HZ), _FASTEST_HZ)
        normal = _direction(rng)
        kind = rng.integers(3)
        if kind == 0:
            path = circle(size, tuple(centre), hz, tuple(normal))
        elif kind == 1:
            path = figure_eight(size, tuple(centre), hz, tuple(normal))
        else:
            path = line(tuple(centre - size * normal), tuple(centre + size * normal), hz)
        # At as many points of a slow one as of a fast one: they are smooth, and each reset draws
        # one.
        begin = beginning_if_reachable(path, _LOOKS)
        if begin is not None:
            return path, begin


def _direction(rng: np.random.Generator) -> NDArray[np.float64]:
    drawn = rng.standard_normal(3)
    return drawn / np.linalg.norm(drawn)
