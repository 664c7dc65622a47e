"""Courses: `lay_out` makes a `Course` from a seed, and `scene` draws it."""

from __future__ import annotations

import dataclasses
import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.world import Pose
from shapechanger.errors import WorldError, require_known
from shapechanger.vehicles.courses.course import FLOODED, Course
from shapechanger.vehicles.courses.geometry import distances_from_obstacle, turn_angles
from shapechanger.vehicles.courses.layouts import corridor, open_course

WORLDS: Final = ("corridor", "yard", "harbour", FLOODED)
"""Kinds of course."""

_ATTEMPTS: Final = 500


def lay_out(world: str, seed: int) -> Course:
    """Lay out the course of a seed, >= 0, in one of `WORLDS`; it is the same on every machine."""
    if world == FLOODED:
        return dataclasses.replace(lay_out("corridor", seed), world=world)
    require_known("world", WORLDS, world)
    if seed < 0:
        raise WorldError(f"The seed of a course must be at least 0, got {seed}.")
    rng = np.random.default_rng([zlib.crc32(world.encode()), seed])
    for _ in range(_ATTEMPTS):
        is_open = world != "corridor"
        course = open_course(world, rng, seed) if is_open else corridor(rng, seed)
        if course is not None:
            return course
    raise WorldError(f"No {world} with seed {seed} can be laid out: use another seed.")


_BEHIND_M, _AHEAD_M, _BESIDE_M = 1.0, 2.0, 0.35
_STRAIGHT_RAD: Final = 0.35


def start_pose(course: Course, seed: int) -> Pose:
    """Draw a free pose on the route, in driving direction; its first point if there is no free one.

    A free pose has no obstacle within 0.35 m of the route from 1 m behind it to 2 m ahead, and the
    metre behind it is nearly straight, so that a trailer fits too.
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
    # If no point is free, take the first point of the route, where no obstacles are placed.
    i = int(places[int(np.random.default_rng(seed).integers(len(places)))]) if len(places) else 0
    dx, dy = ahead[i] - route[i - 1]
    return Pose(float(route[i, 0]), float(route[i, 1]), float(np.arctan2(dy, dx)))


def _sums(
    values: NDArray[np.float64] | NDArray[np.bool_], behind: int, before: int
) -> NDArray[np.float64]:
    """For each point of a closed line, sum its value, `behind` earlier and `before` later ones."""
    whole = np.concatenate([values[-behind:], values, values[:before]])
    sums = np.concatenate([[0.0], np.cumsum(whole)])
    window = behind + before + 1
    return sums[window:] - sums[:-window]
