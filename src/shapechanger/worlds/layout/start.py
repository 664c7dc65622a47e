"""Places to begin at."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course
from shapechanger.worlds.layout.distances import from_thing
from shapechanger.worlds.layout.lines import turns
from shapechanger.worlds.world import Pose

__all__ = ["start_pose"]

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
    for thing in course.things:
        free &= from_thing(thing, steps) > _BESIDE_M
    behind, before = (round(reach / course.spacing) for reach in (_BEHIND_M, _AHEAD_M))
    bend = _sums(turns(route), behind, 0)
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
