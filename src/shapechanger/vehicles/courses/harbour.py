"""Surroundings of a harbour's lane: quays, their fittings, moored boats and a far shore.

It is drawn only. But for dinghies, which are obstacles, and for tyres and ladders, which stand out
of their wall by 2 cm at most, all of it is behind the walls, where no vehicle comes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from shapechanger.vehicles.courses.course import Course, Wall
from shapechanger.vehicles.courses.geometry import distances_to_segments, wall_segments
from shapechanger.vehicles.courses.surfaces import Array, QuadMesh, extent

BANK_M: Final = 0.4
"""Width of quays and rocks; two parts of the lane are at least twice this apart."""

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
        flat = np.array([start, end, wall.end, wall.start])
        corners = np.column_stack([flat, np.full(4, wall.height)])[None]
        far = wall.frame()[2] / _PAVING_PERIOD
        uvs = np.array([[(0.0, 0.0), (far, 0.0), (far, 1.0), (0.0, 1.0)]])
        name = "paving" if wall.surface == "quay" else wall.surface
        walls[name].add(corners, uvs, light(flat)[None], reflected=False)
        rear = np.array([(*start, 0.0), (*end, 0.0), (*end, wall.height), (*start, wall.height)])
        walls[wall.surface].add(rear[None], uvs[:, [3, 2, 1, 0]], 0.72, reflected=False)


def _rears(walls: tuple[Wall, ...]) -> list[tuple[Array, Array]]:
    """Corners of the walls' rear sides, m, each shared with the next wall."""
    ending = {wall.end: wall for wall in walls}
    starting = {wall.start: wall for wall in walls}

    def corner(point: tuple[float, float], wall: Wall, other: Wall) -> Array:
        back = wall.behind() + other.behind()
        # Both walls' rear sides are as far back.
        return np.asarray(point) + 2.0 * BANK_M * back / max(1.0, float(back @ back))

    return [
        (
            corner(wall.start, wall, ending.get(wall.start, wall)),
            corner(wall.end, wall, starting.get(wall.end, wall)),
        )
        for wall in walls
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
    _add_village(mesh, course, rng)
    return mesh


class MooredBoat(NamedTuple):
    """A boat behind a quay: middle, m, direction of its bow, rad, length, m, and kind."""

    x: float
    y: float
    yaw: float
    length: float
    kind: str


def moored(course: Course) -> list[MooredBoat]:
    """Boats along the rear sides of quays, as many as there is room for."""
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
        if all(
            np.hypot(boat.x - other.x, boat.y - other.y) > 0.55 * (length + other.length)
            for other in placed
        ):
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


def _add_village(mesh: QuadMesh, course: Course, rng: np.random.Generator) -> None:
    """Add houses in two groups at the foot of the hills, and a lighthouse."""
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
