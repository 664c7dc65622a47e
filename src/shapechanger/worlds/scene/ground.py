"""The ground of a course, and what is over it: a ceiling with lamps."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.course import Course
from shapechanger.worlds.scene.light import Light
from shapechanger.worlds.scene.patches import Array, Patches

__all__ = ["ceiling_patches", "ground_patches", "lamp_patches", "verge_patches"]

# Size of a patch indoors, where the light changes, and outdoors, m.
_FINE: Final = 0.6
_COARSE: Final = 3.0
# How far the ground goes on behind the walls, m; farther out it is under the horizon's pixel.
_INDOORS_BEHIND: Final = 0.8
_OUTDOORS_BEHIND: Final = 30.0
# Width of the picture on the ground, and on the ceiling, m.
_GROUND_PERIOD: Final = 3.0
_CEILING_PERIOD: Final = 2.4
# Lamps hang this far below the ceiling, m; verges lie this far above the ground.
_GAP: Final = 0.02
_VERGE_RISE: Final = 0.004
_VERGE_WIDTH: Final = 0.4


def ground_patches(course: Course, light: Light) -> Patches:
    """The ground under the lane and a little farther, seen from above."""
    corners = _tiles(course)
    patches = Patches()
    patches.add(
        np.concatenate([corners, np.zeros((*corners.shape[:2], 1))], axis=2),
        corners / _GROUND_PERIOD,
        light.on_ground(corners),
    )
    return patches


def ceiling_patches(course: Course, light: Light) -> Patches:
    """The ceiling, seen from below."""
    corners = _tiles(course)[:, ::-1]
    patches = Patches()
    patches.add(
        np.concatenate([corners, np.full((*corners.shape[:2], 1), course.ceiling_m)], axis=2),
        corners / _CEILING_PERIOD,
        0.9 * light.on_ground(corners),
    )
    return patches


def lamp_patches(course: Course, place: Array) -> Patches:
    """The lamps, seen from below; each shows the texture at one `place` (2,)."""
    patches = Patches()
    for lamp in course.lamps:
        cos, sin = np.cos(lamp.yaw), np.sin(lamp.yaw)
        half = 0.5 * np.array([(1, -1), (-1, -1), (-1, 1), (1, 1)]) * (lamp.length, lamp.width)
        corners = np.full((1, 4, 3), course.ceiling_m - _GAP)
        corners[0, :, 0] = lamp.x + cos * half[:, 0] - sin * half[:, 1]
        corners[0, :, 1] = lamp.y + sin * half[:, 0] + cos * half[:, 1]
        patches.add(corners, np.tile(place, (1, 4, 1)))
    return patches


def verge_patches(course: Course, light: Light) -> Patches:
    """Strips of grass along the feet of the walls."""
    patches = Patches()
    for wall in course.walls:
        start, end = np.asarray(wall.start, float), np.asarray(wall.end, float)
        length = float(np.hypot(*(end - start)))
        if length <= 0.0:
            continue
        along = (end - start) / length
        inwards = _VERGE_WIDTH * np.array([-along[1], along[0]])
        flat = np.array([start, end, end + inwards, start + inwards])
        corners = np.concatenate([flat, np.full((4, 1), _VERGE_RISE)], axis=1)[None]
        far = length / 1.5
        places = np.array([[(0.0, 0.2), (far, 0.2), (far, 0.0), (0.0, 0.0)]])
        patches.add(corners, places, light.on_ground(flat)[None])
    return patches


def _tiles(course: Course) -> Array:
    """Corners (n, 4, 2) of the tiles that cover the lane, counter-clockwise from above."""
    indoors = course.ceiling_m > 0.0
    size = _FINE if indoors else _COARSE
    reach = float(course.half_width.max()) + (_INDOORS_BEHIND if indoors else _OUTDOORS_BEHIND)
    low, high = course.route.min(axis=0) - reach, course.route.max(axis=0) + reach
    count = np.ceil((high - low) / size).astype(int)
    origin = low + size * np.argwhere(np.ones(count, bool))
    if indoors:
        # Under what nobody gets to see there is no floor: the hall is long, and its lane narrow.
        every = max(1, int(size / course.spacing))
        gaps = (origin + 0.5 * size)[:, None, :] - course.route[::every]
        near = (gaps * gaps).sum(axis=2).min(axis=1) < (reach + size) ** 2
        origin = origin[near]
    return origin[:, None, :] + size * np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
