"""How bright each place of a course is."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.course import Course
from shapechanger.worlds.look import Look
from shapechanger.worlds.scene.patches import Array

__all__ = ["Light"]

# Half of a lamp's light is gone this far to its side, m: about its height above the ground.
_REACH: Final = 1.6
# What a wall that looks away from the sun keeps of its light.
_SHADE: Final = 0.72
# What is left far from any lamp at full contrast, and under the open sky.
_DARKEST: Final = 0.12
_CLOUDED: Final = 0.6


class Light:
    """The light on walls and ground, worked out beforehand.

    Args:
        course: Its lamps, or patches of sun; without any, all is as bright as the sky.
        look: Its contrast.
    """

    def __init__(self, course: Course, look: Look) -> None:
        self._lamps = np.array([(lamp.x, lamp.y) for lamp in course.lamps]).reshape(-1, 2)
        self._contrast = look.contrast
        self._darkest = _DARKEST if course.ceiling_m > 0.0 else _CLOUDED
        # Where the sun is, or which side the lamps shine to, follows from the course.
        self._sun = np.random.default_rng([course.seed, 77]).uniform(-np.pi, np.pi)

    def on_ground(self, points: Array) -> Array:
        """Light at points (..., 2), 0 to 1."""
        if not len(self._lamps):
            return np.ones(points.shape[:-1])
        flat = points.reshape(-1, 1, 2) - self._lamps
        away = (flat * flat).sum(axis=2) / (_REACH * _REACH)
        total = 1.0 - np.exp(-1.2 * (1.0 / (1.0 + away * away)).sum(axis=1))
        dark = 1.0 - self._contrast * (1.0 - self._darkest)
        return (dark + (1.0 - dark) * total).reshape(points.shape[:-1])

    def facing(self, angle: float) -> float:
        """What is left of it on a wall whose front looks along `angle`, rad; 0 to 1."""
        turned = 0.5 + 0.5 * np.cos(angle - self._sun)
        return float(1.0 - (1.0 - _SHADE) * min(1.0, 2.0 * self._contrast) * (1.0 - turned))
