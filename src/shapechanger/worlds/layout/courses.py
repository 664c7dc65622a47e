"""Courses by the name of their world and a seed."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import UnknownName, WorldError
from shapechanger.worlds.course import Course, Obstacle
from shapechanger.worlds.layout.channel import harbour, yard
from shapechanger.worlds.layout.corridor import corridor
from shapechanger.worlds.layout.geometry import distances_from_obstacle, turn_angles, wall_segments
from shapechanger.worlds.world import Pose

__all__ = ["WORLDS", "lay_out", "occupancy", "start_pose"]

_MAKERS: Final[Mapping[str, Callable[[np.random.Generator, int], Course | None]]] = (
    MappingProxyType({"corridor": corridor, "yard": yard, "harbour": harbour})
)

WORLDS: Final = tuple(_MAKERS)
"""Names of the worlds that can be laid out."""

_ATTEMPTS: Final = 500


def lay_out(world: str, seed: int) -> Course:
    """The course that belongs to a seed: the same one whenever and wherever it is asked for.

    Args:
        world: One of `WORLDS`.
        seed: From 0. `TRAINING` and `HELD_OUT` of `shapechanger.worlds.course` say which are for
            what.

    Raises:
        UnknownName: If there is no such world.
        WorldError: If the seed is negative, or chance makes no course that fits.
    """
    if world not in _MAKERS:
        raise UnknownName("world", world, WORLDS)
    if seed < 0:
        raise WorldError(f"Seeds of courses count from 0, and {seed} is less.")
    rng = np.random.default_rng([zlib.crc32(world.encode()), seed])
    for _ in range(_ATTEMPTS):
        course = _MAKERS[world](rng, seed)
        if course is not None:
            return course
    raise WorldError(
        f"No {world} with seed {seed} can be laid out: {_ATTEMPTS} attempts came out too tight."
    )


_BEHIND_M: Final = 1.0
_AHEAD_M: Final = 2.0
_BESIDE_M: Final = 0.35
_STRAIGHT_RAD: Final = 0.35


def start_pose(course: Course, seed: int) -> Pose:
    """A place on the middle of the lane, in driving direction, where a vehicle fits.

    Nothing stands within 0.35 m of the route from 1 m behind to 2 m ahead, and the metre behind is
    nearly straight, so that a trailer fits too.

    Args:
        course: Where to begin.
        seed: Which of the places.
    """
    route = course.route
    free = np.ones(len(route), dtype=bool)
    ahead = np.roll(route, -1, axis=0)
    steps = np.concatenate([route, ahead], axis=1)
    for obstacle in course.obstacles:
        free &= distances_from_obstacle(obstacle, steps) > _BESIDE_M
    behind, before = (round(reach / course.spacing) for reach in (_BEHIND_M, _AHEAD_M))
    bend = _sums(turn_angles(route), behind, 0)
    places = np.flatnonzero((_sums(~free, behind, before) < 0.5) & (np.abs(bend) < _STRAIGHT_RAD))
    # Where there is none, the first point of the route is the freest: nothing stands near it.
    i = int(places[int(np.random.default_rng(seed).integers(len(places)))]) if len(places) else 0
    dx, dy = ahead[i] - route[i - 1]
    return Pose(float(route[i, 0]), float(route[i, 1]), float(np.arctan2(dy, dx)))


def _sums(
    values: NDArray[np.float64] | NDArray[np.bool_], behind: int, before: int
) -> NDArray[np.float64]:
    """Of each value of a closed line with so many behind it and so many before it."""
    whole = np.concatenate([values[-behind:], values, values[:before]])
    sums = np.concatenate([[0.0], np.cumsum(whole)])
    window = behind + before + 1
    return sums[window:] - sums[:-window]


def occupancy(course: Course, cell_m: float) -> tuple[NDArray[np.bool_], tuple[float, float]]:
    """Where something is in the way, seen from above.

    Args:
        course: What to look at.
        cell_m: Width of a cell, m.

    Returns:
        The grid, shape (rows, columns), True where the middle of a cell is outside the lane or
        inside a thing; rows go along y and columns along x, and all cells of the rim are blocked.
        And x and y of the middle of cell [0, 0], m: cell [r, c] is at x + c * cell_m and
        y + r * cell_m.

    Raises:
        WorldError: If the width of a cell is not positive.
    """
    if not cell_m > 0.0:
        raise WorldError(f"A cell must be wider than 0 m, and this one is {cell_m} m wide.")
    feet = wall_segments(course.walls)
    low = np.minimum(feet[:, :2], feet[:, 2:]).min(axis=0) - 1.5 * cell_m
    high = np.maximum(feet[:, :2], feet[:, 2:]).max(axis=0) + 1.5 * cell_m
    columns, rows = (int(n) + 1 for n in np.ceil((high - low) / cell_m))
    x0, y0 = float(low[0]), float(low[1])
    y = y0 + cell_m * np.arange(rows)
    # Whoever comes from outside along a row is inside after an odd number of walls.
    x1, y1, x2, y2 = np.hsplit(feet, 4)
    wall, row = np.nonzero((y1 <= y) != (y2 <= y))
    share = (y[row] - y1[wall, 0]) / (y2[wall, 0] - y1[wall, 0])
    x = x1[wall, 0] + share * (x2[wall, 0] - x1[wall, 0])
    crossings = np.zeros((rows, columns), dtype=np.int32)
    np.add.at(crossings, (row, np.ceil((x - x0) / cell_m).astype(np.intp)), 1)
    blocked = np.cumsum(crossings, axis=1) % 2 == 0
    for obstacle in course.obstacles:
        _fill(blocked, obstacle, x0, y0, cell_m)
    return blocked, (x0, y0)


def _fill(
    blocked: NDArray[np.bool_], obstacle: Obstacle, x0: float, y0: float, cell_m: float
) -> None:
    """Block the cells below a thing."""
    reach = float(np.hypot(obstacle.length, obstacle.width)) / 2.0
    rows, columns = blocked.shape
    c1 = max(0, int((obstacle.x - reach - x0) / cell_m))
    c2 = min(columns, int((obstacle.x + reach - x0) / cell_m) + 2)
    r1 = max(0, int((obstacle.y - reach - y0) / cell_m))
    r2 = min(rows, int((obstacle.y + reach - y0) / cell_m) + 2)
    x = x0 - obstacle.x + cell_m * np.arange(c1, c2, dtype=np.float64)[None, :]
    y = y0 - obstacle.y + cell_m * np.arange(r1, r2, dtype=np.float64)[:, None]
    if obstacle.is_round:
        inside = np.hypot(x, y) <= obstacle.length / 2.0
    else:
        c, s = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
        inside = np.abs(x * c + y * s) <= obstacle.length / 2.0
        inside &= np.abs(y * c - x * s) <= obstacle.width / 2.0
    blocked[r1:r2, c1:c2] |= inside
