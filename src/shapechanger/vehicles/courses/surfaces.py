"""Surfaces of a course as meshes with precomputed light: ground, ceiling, walls and obstacles.

Obstacles, boats and the fittings of quays are the solids of `solids.obj`.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.vehicles.bodies.visuals import read_obj
from shapechanger.vehicles.courses.course import Course, Look, Wall

Array = NDArray[np.float64]

_SOLIDS: Final = Path(__file__).with_name("solids.obj")
# The corners of a quad are counter-clockwise seen from its front.
_TRIANGLES: Final = np.array([[0, 1, 2], [0, 2, 3]])
# A mirrored quad has the opposite order.
_MIRRORED: Final = np.array([[0, 2, 1], [0, 3, 2]])
_DOWN: Final = np.array([1.0, 1.0, -1.0])


class QuadMesh:
    """Quads with texture coordinates and light.

    Each has four corners, counter-clockwise seen from its front; its back is invisible. Texture
    coordinates are u to the right and v down, from 0 to 1.
    """

    def __init__(self) -> None:
        self._quads: list[tuple[Array, Array, Array, NDArray[np.bool_]]] = []

    def add(
        self, corners: Array, uvs: Array, lights: Array | float = 1.0, *, reflected: bool = True
    ) -> None:
        """Add n quads.

        Corners are (n, 4, 3), m, texture coordinates (n, 4, 2), and lights, 0 to 1, (n, 4). What is
        not `reflected` is hidden in a glossy ground.
        """
        lights = np.broadcast_to(lights, corners.shape[:2])
        self._quads.append((corners, uvs, lights, np.full(len(corners), reflected)))

    def add_grid(self, points: Array, uvs: Array, lights: Array) -> None:
        """Add the cells of a grid whose rows go up and whose columns go right, seen from its front.

        Its arrays have the shapes (rows, columns, 3), (rows, columns, 2) and (rows, columns).
        """
        self.add(*(_grid_cells(grid) for grid in (points, uvs, lights)))

    def add_solid(
        self,
        name: str,
        place: ArrayLike,
        yaw: float,
        scale: ArrayLike = 1.0,
        light: float = 1.0,
        *,
        reflected: bool = True,
    ) -> None:
        """Add a solid, scaled and turned by a yaw, rad, about its origin, at a place, m, (3,).

        The wall of a fitting is along x, with the lane at y > 0.
        """
        faces, uvs = read_obj(_SOLIDS)[name][name]
        cosine, sine = np.cos(yaw), np.sin(yaw)
        turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        corners = faces * np.asarray(scale) @ turn + np.asarray(place)
        self.add(corners, uvs[..., :2], light * uvs[..., 2], reflected=reflected)

    def __bool__(self) -> bool:
        return bool(self._quads)

    def arrays(self, mirrored: bool) -> tuple[Array, Array, Array, NDArray[np.int64]]:
        """Points, m, (m, 3), texture coordinates, (m, 2), lights, (m,), and triangles, (k, 3).

        `mirrored` adds a copy below the ground, for a glossy ground.
        """
        corners, uvs, lights, shown = map(np.concatenate, zip(*self._quads, strict=True))
        first = np.arange(0, 4 * len(corners), 4)[:, None, None]
        triangles = first + _TRIANGLES
        if mirrored:
            first = first[: shown.sum()] + 4 * len(corners)
            triangles = np.concatenate([triangles, first + _MIRRORED])
            corners = np.concatenate([corners, corners[shown] * _DOWN])
            uvs, lights = (np.concatenate([values, values[shown]]) for values in (uvs, lights))
        return (
            corners.reshape(-1, 3), uvs.reshape(-1, 2), lights.reshape(-1),
            triangles.reshape(-1, 3),
        )  # fmt: skip


def _grid_cells(grid: Array) -> Array:
    """Values at the corners of each cell of a grid (rows, columns, ...): (n, 4, ...)."""
    corners = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    return np.stack(corners, axis=2).reshape(-1, 4, *grid.shape[2:])


# Horizontal distance at which a lamp's light has halved, m: about its height above the ground.
_REACH: Final = 1.6
# Share of the light on a wall that faces away from the sun.
_SHADE: Final = 0.72
# Light far from any lamp at full contrast, indoors and outdoors.
_DARKEST: Final = 0.12
_CLOUDED: Final = 0.6
# Size of a ground patch indoors, where the light varies, and outdoors, m.
_FINE: Final = 0.6
_COARSE: Final = 3.0
# Extent of the ground behind the walls, m; farther out it would be below one pixel.
_INDOORS_BEHIND: Final = 0.8
_OUTDOORS_BEHIND: Final = 30.0
# Width of the ground's and the ceiling's texture, m.
_GROUND_PERIOD: Final = 3.0
_CEILING_PERIOD: Final = 2.4
# Distance of lamps below the ceiling, and of verges above the ground, m.
_GAP: Final = 0.02
_VERGE_RISE: Final = 0.004
_VERGE_WIDTH: Final = 0.4
# Width of repeating textures, m.
_PERIOD: Final = {
    "plaster": 4.0, "panel": 4.0, "brick": 1.2, "hedge": 1.5, "fence": 1.2, "quay": 2.4,
    "shed": 2.0, "rock": 2.0,
}  # fmt: skip
# Width of textures that show one object, which is fitted into its wall, m.
_WHOLE: Final = {"door": 1.0, "window": 1.8, "board": 2.6, "glass": 1.4}
# Share of the plastered walls with wooden panels.
_CLAD: Final = 0.2
# Height of the brick texture, m, which repeats; the others are stretched to the wall.
_BRICK_HEIGHT: Final = 1.8
# Height of a door with its frame, m, below plaster.
_DOOR_HEIGHT: Final = 2.1
# Longest patch of a wall, m: shorter than the distance between two lamps, over which light varies.
_LONGEST: Final = 0.8
# Relative heights at which a wall's light is computed, and its factor there.
_ROWS: Final = np.array([0.0, 0.35, 1.0])
_UPWARDS: Final = np.array([0.86, 1.0, 0.94])

SHORE_M: Final = 45.0
"""Distance of the far shore from the corners of the course."""


class Surfaces:
    """Surfaces of a course with precomputed light."""

    def __init__(self, course: Course, look: Look) -> None:
        self._course = course
        self._lamps = np.array([(lamp.x, lamp.y) for lamp in course.lamps]).reshape(-1, 2)
        self._contrast = look.contrast
        self._darkest = _DARKEST if course.ceiling_m > 0.0 else _CLOUDED
        # Direction of the sun, or of the lamps, which the course's seed determines.
        self._sun = np.random.default_rng([course.seed, 77]).uniform(-np.pi, np.pi)

    def ground(self) -> QuadMesh:
        """Ground of the lane and a margin, seen from above."""
        corners = self._tiles()
        if self._course.world == "harbour":
            corners = np.concatenate([corners, self._open_water(corners)])
        return _level(corners, 0.0, _GROUND_PERIOD, self.light_at(corners))

    def ceiling(self) -> QuadMesh:
        """Ceiling, seen from below."""
        corners = self._tiles()[:, ::-1]
        return _level(
            corners, self._course.ceiling_m, _CEILING_PERIOD, 0.9 * self.light_at(corners)
        )

    def lamps(self) -> QuadMesh:
        """Lamps, seen from below, with the middle of their texture cell everywhere."""
        mesh, z = QuadMesh(), self._course.ceiling_m - _GAP
        for lamp in self._course.lamps:
            mesh.add_solid("lamp", (lamp.x, lamp.y, z), lamp.yaw, (lamp.length, lamp.width, 0.0))
        return mesh

    def verges(self) -> QuadMesh:
        """Strips of grass along the walls."""
        mesh = QuadMesh()
        for wall in self._course.walls:
            inwards = -_VERGE_WIDTH * wall.behind()
            start, end = np.array(wall.start), np.array(wall.end)
            flat = np.array([start, end, end + inwards, start + inwards])
            far = wall.frame()[2] / 1.5
            uvs = np.array([[(0.0, 0.2), (far, 0.2), (far, 0.0), (0.0, 0.0)]])
            mesh.add(_raised(flat[None], _VERGE_RISE), uvs, self.light_at(flat)[None])
        return mesh

    def walls(self) -> dict[str, QuadMesh]:
        """Meshes of all walls, keyed by texture."""
        result: dict[str, QuadMesh] = defaultdict(QuadMesh)
        rng = np.random.default_rng([self._course.seed, 78])
        for number, wall in enumerate(self._course.walls):
            clad = rng.random() < _CLAD
            # Walls of one kind start with different parts of the texture.
            offset = (0.37 * number) % 1.0
            if wall.surface == "door" and wall.height > _DOOR_HEIGHT + 0.05:
                self._add_wall(result["door"], wall, 0.0, _DOOR_HEIGHT, offset)
                self._add_wall(result["plaster"], wall, _DOOR_HEIGHT, wall.height, offset)
            else:
                name = "panel" if clad and wall.surface == "plaster" else wall.surface
                self._add_wall(result[name], wall, 0.0, wall.height, offset)
        return result

    def obstacles(self) -> QuadMesh:
        """All obstacles of a course, which share one texture."""
        mesh = QuadMesh()
        for obstacle in self._course.obstacles:
            place, size = (
                (obstacle.x, obstacle.y),
                (obstacle.length, obstacle.width, obstacle.height),
            )
            light = float(self.light_at(np.array(place)))
            has_cabin = obstacle.kind == "dinghy" and round(1000.0 * obstacle.length) % 2
            name = "cabin dinghy" if has_cabin else obstacle.kind
            mesh.add_solid(name, (*place, 0.0), obstacle.yaw, size, light)
        return mesh

    def light_at(self, points: Array) -> Array:
        """Light at points, m, (..., 2), from 0 to 1."""
        if not len(self._lamps):
            return np.ones(points.shape[:-1])
        flat = points.reshape(-1, 1, 2) - self._lamps
        away = (flat * flat).sum(axis=2) / (_REACH * _REACH)
        total = 1.0 - np.exp(-1.2 * (1.0 / (1.0 + away * away)).sum(axis=1))
        dark = 1.0 - self._contrast * (1.0 - self._darkest)
        return (dark + (1.0 - dark) * total).reshape(points.shape[:-1])

    def _facing(self, angle: float) -> float:
        """Factor on a wall whose front faces `angle`, rad; 0 to 1."""
        turned = 0.5 + 0.5 * np.cos(angle - self._sun)
        return float(1.0 - (1.0 - _SHADE) * min(1.0, 2.0 * self._contrast) * (1.0 - turned))

    def _tiles(self) -> Array:
        """Corners of the tiles that cover the lane, counter-clockwise from above, m, (n, 4, 2)."""
        indoors = self._course.ceiling_m > 0.0
        size = _FINE if indoors else _COARSE
        behind = _INDOORS_BEHIND if indoors else _OUTDOORS_BEHIND
        if self._course.world == "harbour":
            behind = _COARSE
        reach = float(self._course.half_width.max()) + behind
        low, high = self._course.route.min(axis=0) - reach, self._course.route.max(axis=0) + reach
        count = np.ceil((high - low) / size).astype(int)
        origin = low + size * np.argwhere(np.ones(count, bool))
        if indoors:
            # Tiles far from the route are invisible.
            every = max(1, int(size / self._course.spacing))
            gaps = (origin + 0.5 * size)[:, None, :] - self._course.route[::every]
            near = (gaps * gaps).sum(axis=2).min(axis=1) < (reach + size) ** 2
            origin = origin[near]
        return origin[:, None, :] + size * np.array([(0, 0), (1, 0), (1, 1), (0, 1)])

    def _open_water(self, tiles: Array) -> Array:
        """Corners of four large tiles around the others, up to the far shore, m, (4, 4, 2)."""
        (x0, y0), (x1, y1) = tiles.min(axis=(0, 1)), tiles.max(axis=(0, 1))
        middle, radius = extent(self._course)
        (left, bottom), (right, top) = middle - radius, middle + radius
        around = (
            (left, bottom, right, y0), (left, y1, right, top), (left, y0, x0, y1),
            (x1, y0, right, y1),
        )  # fmt: skip
        return np.array([[(a, b), (c, b), (c, d), (a, d)] for a, b, c, d in around])

    def _add_wall(self, mesh: QuadMesh, wall: Wall, low: float, high: float, offset: float) -> None:
        """Add a wall between two heights, m, in pieces short enough for the light to vary."""
        start, end, (_, _, length) = np.array(wall.start), np.array(wall.end), wall.frame()
        share = np.linspace(0.0, 1.0, max(1, int(np.ceil(length / _LONGEST))) + 1)
        # Seen from the front, the end of the wall is on the left.
        base = end + share[:, None] * (start - end)
        across, down = _spread(wall, length, low, high)
        points, uvs = np.empty((len(_ROWS), len(share), 3)), np.empty((len(_ROWS), len(share), 2))
        points[..., :2], points[..., 2] = base, (low + _ROWS * (high - low))[:, None]
        uvs[..., 0] = offset * (wall.surface in _PERIOD) + across * share
        uvs[..., 1] = (1.0 - _ROWS[:, None]) * down
        dx, dy = end - start
        facing = self._facing(float(np.arctan2(dx, -dy)))
        mesh.add_grid(points, uvs, _UPWARDS[:, None] * (facing * self.light_at(base)))


def extent(course: Course) -> tuple[Array, float]:
    """Middle of a course, m, (2,), and radius of the far shore around it, m."""
    low, high = course.route.min(axis=0), course.route.max(axis=0)
    return 0.5 * (low + high), 0.5 * float(np.hypot(*(high - low))) + SHORE_M


def _level(corners: Array, height: float, period: float, lights: Array) -> QuadMesh:
    """Horizontal quads with a texture of a width `period`, m."""
    mesh = QuadMesh()
    mesh.add(_raised(corners, height), corners / period, lights)
    return mesh


def _raised(corners: Array, height: float) -> Array:
    """Corners, m, (n, 4, 2), at a height, m: (n, 4, 3)."""
    return np.concatenate([corners, np.full((*corners.shape[:2], 1), height)], axis=2)


def _spread(wall: Wall, length: float, low: float, high: float) -> tuple[float, float]:
    """Repetitions of the texture along the wall and upwards."""
    if low > 0.0:
        # Above a door: the upper part of the plaster, without its skirting board.
        return length / _PERIOD["plaster"], (high - low) / wall.height
    if wall.surface in _WHOLE:
        return float(max(1, round(length / _WHOLE[wall.surface]))), 1.0
    return length / _PERIOD[wall.surface], high / _BRICK_HEIGHT if wall.surface == "brick" else 1.0
