"""Surroundings of a harbour's lane: quays, their fittings, moored boats and a far shore.

It is drawn only. But for dinghies, which are obstacles, and for tyres and ladders, which stand out
of their wall by 2 cm at most, all of it is behind the walls, where no vehicle comes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from shapechanger.vehicles.bodies.visuals import read_obj, shading
from shapechanger.vehicles.courses.course import Course, Obstacle, Wall
from shapechanger.vehicles.courses.textures import Array, QuadMesh

BANK_M: Final = 0.4
"""Width of quays and rocks; two parts of the lane are at least twice this apart."""

SHORE_M: Final = 45.0
"""Distance of the far shore from the corners of the course."""

_PAVING_PERIOD: Final = 2.4
# Probabilities that a quay wall of 2 m has them.
_BOLLARD, _TYRE, _LADDER = 0.55, 0.4, 0.12
_MOST_BOATS: Final = 12
_KINDS: Final = ("sail", "motor", "fishing")
_BEAM: Final = 0.34  # Width of a boat over its length.
_SPACE_M: Final = 0.15  # Between a moored boat and its quay.
_SHORE_SIDES: Final = 72
_HILL_M: Final = (2.0, 9.0)
_HOUSES: Final = 26


def add_banks(course: Course, walls: dict[str, QuadMesh], light: Callable[[Array], Array]) -> None:
    """Add tops and rear sides to the meshes of walls, so that they are quays and moles from above.

    `light` returns the brightness at points, m, (..., 2), from 0 to 1; tops of quays are "paving".
    """
    for wall, (start, end) in zip(course.walls, _rears(course.walls), strict=True):
        front = np.array([wall.start, wall.end])
        length = float(np.hypot(*(front[1] - front[0])))
        flat = np.array([front[0], front[1], end, start])[::-1]
        corners = np.column_stack([flat, np.full(4, wall.height)])[None]
        far = length / _PAVING_PERIOD
        uvs = np.array([[(0.0, 0.0), (far, 0.0), (far, 1.0), (0.0, 1.0)]])
        name = "paving" if wall.surface == "quay" else wall.surface
        walls.setdefault(name, QuadMesh()).add(corners, uvs, light(flat)[None], reflected=False)
        rear = np.array([(*start, 0.0), (*end, 0.0), (*end, wall.height), (*start, wall.height)])
        uvs = np.array([[(0.0, 1.0), (far, 1.0), (far, 0.0), (0.0, 0.0)]])
        walls[wall.surface].add(rear[None], uvs, 0.72, reflected=False)


def _rears(walls: tuple[Wall, ...]) -> list[tuple[Array, Array]]:
    """Corners of the walls' rear sides, m, each shared with the next wall."""
    ends = {_key(wall.end): i for i, wall in enumerate(walls)}
    starts = {_key(wall.start): i for i, wall in enumerate(walls)}
    behind = np.array([_behind(wall) for wall in walls])

    def corner(point: tuple[float, float], own: int, other: int | None) -> Array:
        back = behind[own] + behind[own if other is None else other]
        # Both walls' rear sides are as far back.
        return np.asarray(point) + 2.0 * BANK_M * back / max(1.0, float(back @ back))

    return [
        (
            corner(wall.start, i, ends.get(_key(wall.start))),
            corner(wall.end, i, starts.get(_key(wall.end))),
        )
        for i, wall in enumerate(walls)
    ]


def _key(point: tuple[float, float]) -> tuple[int, int]:
    return round(point[0] * 1e6), round(point[1] * 1e6)


def _behind(wall: Wall) -> Array:
    """Unit vector away from the lane, (2,)."""
    along = np.asarray(wall.end) - wall.start
    return np.array([along[1], -along[0]]) / np.hypot(*along)


def fittings(course: Course) -> QuadMesh:
    """Bollards, tyres and ladders on the quays, boats behind them, and houses on the far shore."""
    rng = np.random.default_rng([course.seed, 79])
    mesh = QuadMesh()
    for wall in course.walls:
        along = np.asarray(wall.end) - wall.start
        length, yaw = float(np.hypot(*along)), float(np.arctan2(along[1], along[0]))
        draws, place = rng.random(2), float(rng.uniform(0.25, 0.75)) * length
        if wall.surface != "quay":
            continue
        x0, y0 = np.asarray(wall.start) + place * along / length
        if draws[0] < _BOLLARD:
            add_solids(mesh, "bollard", (x0, y0, wall.height), yaw, reflected=False)
        x1, y1 = np.asarray(wall.end) - place * along / length
        if draws[1] < _TYRE:
            add_solids(mesh, "tyre", (x1, y1, 0.55 * wall.height), yaw)
        elif draws[1] < _TYRE + _LADDER:
            add_solids(mesh, "ladder", (x1, y1, 0.0), yaw, (1.0, 1.0, wall.height))
    for boat in moored(course):
        add_solids(mesh, boat.kind, (boat.x, boat.y, 0.0), boat.yaw, boat.length)
    _add_village(mesh, course, rng)
    return mesh


_SOLIDS: Final = Path(__file__).parent / "meshes" / "harbour.obj"


def add_solids(
    mesh: QuadMesh,
    name: str,
    place: tuple[float, float, float],
    yaw: float,
    scale: float | tuple[float, float, float] = 1.0,
    light: float = 1.0,
    *,
    reflected: bool = True,
) -> None:
    """Add an object of `meshes/harbour.obj`, turned by a yaw, rad, about its origin at a place, m.

    The wall of a fitting is along x, with the lane at y > 0.
    """
    faces, uvs, bright = _solid(name)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    corners = faces * scale @ turn + np.asarray(place, float)
    mesh.add(corners, uvs, light * bright, reflected=reflected)


@functools.cache
def _solid(name: str) -> tuple[Array, Array, Array]:
    """Faces, texture coordinates and brightness of an object."""
    faces, uvs = read_obj(_SOLIDS)[name][name]
    return faces, uvs, shading(faces)[:, None]


class MooredBoat(NamedTuple):
    """A boat behind a quay: middle, m, direction of its bow, rad, length, m, and kind."""

    x: float
    y: float
    yaw: float
    length: float
    kind: str


def moored(course: Course) -> list[MooredBoat]:
    """Boats along the rear sides of quays, where there is room."""
    rng = np.random.default_rng([course.seed, 80])
    starts = np.array([wall.start for wall in course.walls])
    ways = np.array([wall.end for wall in course.walls]) - starts
    placed: list[MooredBoat] = []
    for i in map(int, rng.permutation(len(course.walls))):
        wall, length = course.walls[i], float(rng.uniform(1.5, 2.8))
        kind = _KINDS[int(rng.integers(len(_KINDS)))]
        yaw = float(np.arctan2(ways[i, 1], ways[i, 0]) + rng.integers(2) * np.pi)
        if wall.surface != "quay" or len(placed) == _MOST_BOATS:
            continue
        half = 0.5 * _BEAM * length
        place: Array = starts[i] + 0.5 * ways[i] + (BANK_M + _SPACE_M + half) * _behind(wall)
        axis = np.linspace(-0.5, 0.5, 5)[:, None] * length * (np.cos(yaw), np.sin(yaw)) + place
        # Distance of each point of its axis from each wall.
        away = axis[:, None, :] - starts
        share = np.clip((away * ways).sum(axis=2) / (ways * ways).sum(axis=1), 0.0, 1.0)
        near = np.linalg.norm(away - share[..., None] * ways, axis=2).min()
        if near < half + BANK_M:
            continue
        boat = MooredBoat(float(place[0]), float(place[1]), yaw, length, kind)
        if all(
            np.hypot(boat.x - other.x, boat.y - other.y) > 0.55 * (length + other.length)
            for other in placed
        ):
            placed.append(boat)
    return placed


def add_dinghy(mesh: QuadMesh, obstacle: Obstacle, light: float) -> None:
    """Add a dinghy, blunt at both ends and so nearly as wide as its collision box."""
    kind = "cabin dinghy" if round(1000.0 * obstacle.length) % 2 else "dinghy"  # Half of them.
    size = obstacle.length, obstacle.width, obstacle.height
    add_solids(mesh, kind, (obstacle.x, obstacle.y, 0.0), obstacle.yaw, size, light)


def extent(course: Course) -> tuple[Array, float]:
    """Middle of a course, m, (2,), and radius of the far shore around it, m."""
    low, high = course.route.min(axis=0), course.route.max(axis=0)
    return 0.5 * (low + high), 0.5 * float(np.hypot(*(high - low))) + SHORE_M


def far_shore(course: Course) -> QuadMesh:
    """Hills around the harbour, seen from within."""
    rng = np.random.default_rng([course.seed, 81])
    middle, radius = extent(course)
    angle = np.linspace(0.0, 2.0 * np.pi, _SHORE_SIDES + 1)[::-1]
    orders = np.array([2.0, 3.0, 5.0, 8.0, 13.0, 21.0])[:, None]
    swing = np.sin(orders * angle + rng.uniform(0.0, 2.0 * np.pi, orders.shape))
    waves: Array = (swing / orders**0.7).sum(axis=0)
    share = (waves - waves.min()) / np.ptp(waves)
    points = np.empty((2, _SHORE_SIDES + 1, 3))
    points[..., 0] = middle[0] + radius * np.cos(angle)
    points[..., 1] = middle[1] + radius * np.sin(angle)
    points[0, :, 2] = 0.0
    points[1, :, 2] = _HILL_M[0] + (_HILL_M[1] - _HILL_M[0]) * share
    uvs = np.empty((2, _SHORE_SIDES + 1, 2))
    uvs[..., 0] = angle / np.pi
    uvs[..., 1] = np.array([[1.0], [0.0]])
    mesh = QuadMesh()
    mesh.add_grid(points, uvs, np.ones(points.shape[:2]))
    return mesh


def _add_village(mesh: QuadMesh, course: Course, rng: np.random.Generator) -> None:
    """Add houses in two groups at the foot of the hills, and a lighthouse."""
    (x, y), radius = extent(course)
    centres = rng.uniform(0.0, 2.0 * np.pi, 2)
    for number in range(_HOUSES):
        angle = float(centres[number % 2] + rng.normal(0.0, 0.22))
        away = radius - float(rng.uniform(1.5, 5.0))
        long, deep, high = map(float, rng.uniform((2.0, 1.6, 1.6), (3.6, 2.4, 3.2)))
        place = float(x + away * np.cos(angle)), float(y + away * np.sin(angle)), 0.0
        yaw = angle + 0.5 * np.pi + float(rng.normal(0.0, 0.3))
        add_solids(mesh, "house", place, yaw, (long, deep, high), reflected=False)
    angle, away = float(centres[0] + 0.9), radius - 6.0
    place = float(x + away * np.cos(angle)), float(y + away * np.sin(angle)), 0.0
    add_solids(mesh, "lighthouse", place, 0.0, reflected=False)
