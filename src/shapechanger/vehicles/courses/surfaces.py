"""Surfaces of a course as meshes with precomputed light: ground, ceiling, walls and obstacles.

A harbour also has fittings on its quays, moored boats and a far shore, without collisions. They are
behind the walls, except tyres and ladders, which stick out of walls by at most 2 cm.
Obstacles, boats and fittings are the solids of `solids.obj`.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.vehicles.bodies.visuals import read_obj
from shapechanger.vehicles.courses.course import Course, Look, Wall
from shapechanger.vehicles.courses.geometry import distances_to_segments, wall_segments

Array = NDArray[np.float64]

_SOLIDS: Final = Path(__file__).with_name("solids.obj")
# Corners of a quad are counter-clockwise seen from its front, and clockwise if it is mirrored.
_TRIANGLES: Final = np.array([[0, 1, 2], [0, 2, 3]])
_MIRRORED: Final = np.array([[0, 2, 1], [0, 3, 2]])


class QuadMesh:
    """Quads with texture coordinates and light.

    Corners of a quad are counter-clockwise seen from its front; its back is invisible. Texture
    coordinates are u to the right and v down, from 0 to 1.
    """

    def __init__(self) -> None:
        self._quads: list[tuple[Array, Array, Array, NDArray[np.bool_]]] = []

    def add(
        self, corners: Array, uvs: Array, lights: Array | float = 1.0, *, reflected: bool = True
    ) -> None:
        """Add n quads.

        Corners are (n, 4, 3), m, texture coordinates (n, 4, 2), and lights, 0 to 1, (n, 4). A
        glossy ground mirrors only `reflected` quads.
        """
        lights = np.broadcast_to(lights, corners.shape[:2])
        self._quads.append((corners, uvs, lights, np.full(len(corners), reflected)))

    def add_grid(self, points: Array, uvs: Array, lights: Array) -> None:
        """Add the cells of a grid whose rows go up and whose columns go right, seen from its front.

        Its arrays have the shapes (rows, columns, 3), (rows, columns, 2) and (rows, columns).
        """

        def cells(grid: Array) -> Array:
            corners = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
            return np.stack(corners, axis=2).reshape(-1, 4, *grid.shape[2:])

        self.add(*map(cells, (points, uvs, lights)))

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

        Before the turn, the wall of a fitting is along x, and the lane at y > 0.
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
            corners = np.concatenate([corners, corners[shown] * (1.0, 1.0, -1.0)])
            uvs, lights = (np.concatenate([values, values[shown]]) for values in (uvs, lights))
        return (
            corners.reshape(-1, 3), uvs.reshape(-1, 2), lights.reshape(-1),
            triangles.reshape(-1, 3),
        )  # fmt: skip


# Horizontal distance at which a lamp's light has halved, m.
_REACH: Final = 1.6
_SHADE: Final = 0.72  # Share of the light on a wall that faces away from the sun.
# Light far from any lamp at full contrast, indoors and outdoors.
_DARKEST, _CLOUDED = 0.12, 0.6
# Size of a ground patch indoors, where the light varies, and outdoors, m.
_FINE, _COARSE = 0.6, 3.0
# Extent of the ground behind the walls, m; farther out it would be below one pixel.
_INDOORS_BEHIND, _OUTDOORS_BEHIND = 0.8, 30.0
# Width of the ground's and the ceiling's texture, m.
_GROUND_PERIOD, _CEILING_PERIOD = 3.0, 2.4
_GAP: Final = 0.02  # Distance of lamps below the ceiling, m.
# Height of verges above the ground, and their width, m.
_VERGE_RISE, _VERGE_WIDTH = 0.004, 0.4
# Width of repeating textures, m.
_PERIOD: Final = {
    "plaster": 4.0, "panel": 4.0, "brick": 1.2, "hedge": 1.5, "fence": 1.2, "quay": 2.4,
    "shed": 2.0, "rock": 2.0,
}  # fmt: skip
# Width of textures that show one object, which is fitted into its wall, m.
_WHOLE: Final = {"door": 1.0, "window": 1.8, "board": 2.6, "glass": 1.4}
_CLAD: Final = 0.2  # Share of the plastered walls with wooden panels.
# Height of the brick texture, m, which repeats; other textures are stretched to the wall.
_BRICK_HEIGHT: Final = 1.8
_DOOR_HEIGHT: Final = 2.1  # Height of a door with its frame, m; plaster is above it.
# Longest patch of a wall, m: shorter than the distance between two lamps, over which light varies.
_LONGEST: Final = 0.8
# Relative heights at which a wall's light is computed, and its factor there.
_ROWS: Final = np.array([0.0, 0.35, 1.0])
_UPWARDS: Final = np.array([0.86, 1.0, 0.94])

_SHORE_M: Final = 45.0  # Distance of the far shore from the corners of the course.


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
        corners, height = self._tiles()[:, ::-1], self._course.ceiling_m
        return _level(corners, height, _CEILING_PERIOD, 0.9 * self.light_at(corners))

    def lamps(self) -> QuadMesh:
        """Lamps, seen from below; all corners have the same texture coordinates: one colour."""
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
        if self._course.world == "harbour":
            self._add_banks(result)
        return result

    def _add_banks(self, walls: dict[str, QuadMesh]) -> None:
        """Add tops and rear sides of walls, so that they are quays and moles from above."""
        course = self._course
        for wall, (start, end) in zip(course.walls, _rears(course.walls), strict=True):
            flat = np.array([start, end, wall.end, wall.start])
            corners = _raised(flat[None], wall.height)
            far = wall.frame()[2] / _PAVING_PERIOD
            uvs = np.array([[(0.0, 0.0), (far, 0.0), (far, 1.0), (0.0, 1.0)]])
            name = "paving" if wall.surface == "quay" else wall.surface
            walls[name].add(corners, uvs, self.light_at(flat)[None], reflected=False)
            z = wall.height
            rear = np.array([[(*start, 0.0), (*end, 0.0), (*end, z), (*start, z)]])
            walls[wall.surface].add(rear, uvs[:, [3, 2, 1, 0]], _SHADE, reflected=False)

    def obstacles(self) -> QuadMesh:
        """All obstacles of a course, which share one texture."""
        mesh = QuadMesh()
        for thing in self._course.obstacles:
            light = float(self.light_at(np.array((thing.x, thing.y))))
            has_cabin = thing.kind == "dinghy" and round(1000.0 * thing.length) % 2
            name = "cabin dinghy" if has_cabin else thing.kind
            size = (thing.length, thing.width, thing.height)
            mesh.add_solid(name, (thing.x, thing.y, 0.0), thing.yaw, size, light)
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
        """Corners of four large tiles around other tiles, up to the far shore, m, (4, 4, 2)."""
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
    return 0.5 * (low + high), 0.5 * float(np.hypot(*(high - low))) + _SHORE_M


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


BANK_M: Final = 0.4
"""Width of quays and rocks; two parts of the lane are at least twice this apart."""

_PAVING_PERIOD: Final = 2.4
# Probabilities of each fitting at a quay wall of 2 m.
_BOLLARD, _TYRE, _LADDER = 0.55, 0.4, 0.12
_MOST_BOATS: Final = 12
_KINDS: Final = ("sail", "motor", "fishing")
_BEAM: Final = 0.34  # Width of a boat divided by its length.
_SPACE_M: Final = 0.15  # Distance between a moored boat and its quay.
_SHORE_SIDES: Final = 72
_HILL_M: Final = (2.0, 9.0)
_HOUSES: Final = 26


def _rears(walls: tuple[Wall, ...]) -> list[tuple[Array, Array]]:
    """Corners of the walls' rear sides, m, each shared with the next wall."""
    ending = {wall.end: wall for wall in walls}
    starting = {wall.start: wall for wall in walls}

    def corner(point: tuple[float, float], wall: Wall, other: Wall) -> Array:
        back = wall.behind() + other.behind()
        # The corner is `BANK_M` behind both walls.
        return np.asarray(point) + 2.0 * BANK_M * back / max(1.0, float(back @ back))

    return [
        (corner(w.start, w, ending.get(w.start, w)), corner(w.end, w, starting.get(w.end, w)))
        for w in walls
    ]


def fittings(course: Course) -> QuadMesh:
    """Bollards, tyres and ladders on the quays, boats behind them, and houses on the far shore."""
    rng = np.random.default_rng([course.seed, 79])
    mesh = QuadMesh()
    for wall in course.walls:
        start, ahead, length = wall.frame()
        yaw = float(np.arctan2(ahead[1], ahead[0]))
        draws, place = rng.random(2), float(rng.uniform(0.25, 0.75)) * length
        if wall.surface != "quay":
            continue
        if draws[0] < _BOLLARD:
            mesh.add_solid("bollard", (*start + place * ahead, wall.height), yaw, reflected=False)
        there = np.asarray(wall.end) - place * ahead
        if draws[1] < _TYRE:
            mesh.add_solid("tyre", (*there, 0.55 * wall.height), yaw)
        elif draws[1] < _TYRE + _LADDER:
            mesh.add_solid("ladder", (*there, 0.0), yaw, (1.0, 1.0, wall.height))
    for boat in moored(course):
        mesh.add_solid(boat.kind, (boat.x, boat.y, 0.0), boat.yaw, boat.length)
    # Houses in two groups at the foot of the hills, and a lighthouse.
    middle, radius = extent(course)
    centres = rng.uniform(0.0, 2.0 * np.pi, 2)

    def build(kind: str, angle: float, away: float, yaw: float, size: tuple[float, ...]) -> None:
        x, y = middle + away * np.array([np.cos(angle), np.sin(angle)])
        mesh.add_solid(kind, (x, y, 0.0), yaw, size, reflected=False)

    for number in range(_HOUSES):
        angle = float(centres[number % 2] + rng.normal(0.0, 0.22))
        away = radius - float(rng.uniform(1.5, 5.0))
        size = tuple(rng.uniform((2.0, 1.6, 1.6), (3.6, 2.4, 3.2)))
        build("house", angle, away, angle + 0.5 * np.pi + float(rng.normal(0.0, 0.3)), size)
    build("lighthouse", float(centres[0] + 0.9), radius - 6.0, 0.0, (1.0, 1.0, 1.0))
    return mesh


class MooredBoat(NamedTuple):
    """A boat behind a quay: middle, m, direction of its bow, rad, length, m, and kind."""

    x: float
    y: float
    yaw: float
    length: float
    kind: str


def moored(course: Course) -> list[MooredBoat]:
    """Up to `_MOST_BOATS` boats along the rear sides of quays, as there is room for them."""
    rng = np.random.default_rng([course.seed, 80])
    segments = wall_segments(course.walls)
    starts, ways = segments[:, :2], segments[:, 2:] - segments[:, :2]
    placed: list[MooredBoat] = []
    for i in map(int, rng.permutation(len(course.walls))):
        wall, length = course.walls[i], float(rng.uniform(1.5, 2.8))
        kind = _KINDS[int(rng.integers(len(_KINDS)))]
        yaw = float(np.arctan2(ways[i, 1], ways[i, 0]) + rng.integers(2) * np.pi)
        if wall.surface != "quay" or len(placed) == _MOST_BOATS:
            continue
        half = 0.5 * _BEAM * length
        place: Array = starts[i] + 0.5 * ways[i] + (BANK_M + _SPACE_M + half) * wall.behind()
        axis = np.linspace(-0.5, 0.5, 5)[:, None] * length * (np.cos(yaw), np.sin(yaw)) + place
        if distances_to_segments(axis, segments).min() < half + BANK_M:
            continue
        boat = MooredBoat(float(place[0]), float(place[1]), yaw, length, kind)
        apart = (np.hypot(boat.x - o.x, boat.y - o.y) / (length + o.length) for o in placed)
        if all(gap > 0.55 for gap in apart):
            placed.append(boat)
    return placed


def far_shore(course: Course) -> QuadMesh:
    """Hills around the harbour, seen from within."""
    rng = np.random.default_rng([course.seed, 81])
    middle, radius = extent(course)
    angle = np.linspace(0.0, 2.0 * np.pi, _SHORE_SIDES + 1)[::-1]
    orders = np.array([2.0, 3.0, 5.0, 8.0, 13.0, 21.0])[:, None]
    swing = np.sin(orders * angle + rng.uniform(0.0, 2.0 * np.pi, orders.shape))
    waves: Array = (swing / orders**0.7).sum(axis=0)
    share = (waves - waves.min()) / np.ptp(waves)
    points, uvs = np.zeros((2, _SHORE_SIDES + 1, 3)), np.zeros((2, _SHORE_SIDES + 1, 2))
    points[..., 0] = middle[0] + radius * np.cos(angle)
    points[..., 1] = middle[1] + radius * np.sin(angle)
    points[1, :, 2] = _HILL_M[0] + (_HILL_M[1] - _HILL_M[0]) * share
    uvs[..., 0], uvs[0, :, 1] = angle / np.pi, 1.0
    mesh = QuadMesh()
    mesh.add_grid(points, uvs, np.ones(points.shape[:2]))
    return mesh
