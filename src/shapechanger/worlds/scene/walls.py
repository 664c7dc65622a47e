"""The walls of a course as patches, by what they are made of."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from shapechanger.worlds.course import Course, Wall
from shapechanger.worlds.scene.light import Light
from shapechanger.worlds.scene.patches import Array, Patches

__all__ = ["wall_patches"]

# Width of what a texture shows, m, of those that go on and on.
_PERIOD: Final[Mapping[str, float]] = MappingProxyType(
    {
        "plaster": 4.0,
        "panel": 4.0,
        "brick": 1.2,
        "hedge": 1.5,
        "fence": 1.2,
        "quay": 2.4,
        "shed": 2.0,
        "rock": 2.0,
    }
)
# Of those that show one whole thing, which is fitted into its wall.
_WHOLE: Final[Mapping[str, float]] = MappingProxyType(
    {"door": 1.0, "window": 1.8, "board": 2.6, "glass": 1.4}
)
# Share of the plastered walls that are clad in wood instead.
_CLAD: Final = 0.2
# A texture of a brick wall is this high, m, and goes on above; the others are drawn out to fit.
_BRICK_HEIGHT: Final = 1.8
# A usual door with its frame, m; above it is the wall it stands in.
_DOOR_HEIGHT: Final = 2.1
# The longest patch, m: the light changes over about the distance between two lamps.
_LONGEST: Final = 0.8
# Places up a wall at which its light is worked out, and what is left there of it.
_ROWS: Final = np.array([0.0, 0.35, 1.0])
_UPWARDS: Final = np.array([0.86, 1.0, 0.94])


def wall_patches(course: Course, light: Light) -> dict[str, Patches]:
    """Patches for each texture that the course has."""
    result: dict[str, Patches] = defaultdict(Patches)
    rng = np.random.default_rng([course.seed, 78])
    for number, wall in enumerate(course.walls):
        clad = rng.random() < _CLAD
        # Walls of one kind do not start with the same part of the texture.
        offset = (0.37 * number) % 1.0
        if wall.surface == "door" and wall.height > _DOOR_HEIGHT + 0.05:
            _add(result["door"], wall, light, 0.0, _DOOR_HEIGHT, offset)
            _add(result["plaster"], wall, light, _DOOR_HEIGHT, wall.height, offset)
        else:
            name = "panel" if clad and wall.surface == "plaster" else wall.surface
            _add(result[name], wall, light, 0.0, wall.height, offset)
    return dict(result)


def _add(
    patches: Patches, wall: Wall, light: Light, low: float, high: float, offset: float
) -> None:
    """The part of a wall between two heights, in pieces short enough for the light to change."""
    start, end = np.asarray(wall.start, float), np.asarray(wall.end, float)
    length = float(np.hypot(*(end - start)))
    if length <= 0.0:
        return
    columns = max(1, int(np.ceil(length / _LONGEST)))
    share = np.linspace(0.0, 1.0, columns + 1)
    across, down = _spread(wall, length, low, high)
    # Who looks at the front has the end of the wall at the left.
    base = end + share[:, None] * (start - end)
    rows = low + _ROWS * (high - low)
    points = np.empty((len(rows), columns + 1, 3))
    points[..., :2] = base
    points[..., 2] = rows[:, None]
    places = np.empty((len(rows), columns + 1, 2))
    places[..., 0] = offset * (wall.surface in _PERIOD) + across * share
    places[..., 1] = (1.0 - _ROWS[:, None]) * down
    along = end - start
    facing = light.facing(float(np.arctan2(along[0], -along[1])))
    lights = _UPWARDS[:, None] * (facing * light.on_ground(base))[None, :]
    patches.add(_cells(points), _cells(places), _cells(lights[..., None])[..., 0])


def _spread(wall: Wall, length: float, low: float, high: float) -> tuple[float, float]:
    """How often the texture is repeated along the wall, and upwards."""
    if low > 0.0:
        # Above a door: the upper part of the plaster, where there is no skirting board.
        return length / _PERIOD["plaster"], (high - low) / wall.height
    if wall.surface in _WHOLE:
        return float(max(1, round(length / _WHOLE[wall.surface]))), 1.0
    return length / _PERIOD[wall.surface], high / _BRICK_HEIGHT if wall.surface == "brick" else 1.0


def _cells(grid: Array) -> Array:
    """The four corners of each cell of a grid (rows, columns, k) whose rows go up: (n, 4, k)."""
    corners = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    return np.stack(corners, axis=2).reshape(-1, 4, grid.shape[-1])
