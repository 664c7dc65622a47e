"""Things put into a lane one by one, so that every vehicle still gets past."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Thing, ThingKind, Wall
from shapechanger.worlds.layout.distances import between, from_thing, segments, to_segments
from shapechanger.worlds.layout.lines import length

__all__ = ["Furniture", "Lane", "Size"]

FREE_AHEAD_M: Final = 3.0
"""Nothing stands this far ahead of the first point of the route."""

FREE_BEHIND_M: Final = 2.0
"""Nor this far behind it: a truck with its trailer is 1 m long."""

_BEFORE_DOORS_M: Final = 0.3
"""Nothing stands this near to a door."""


@dataclass(frozen=True, slots=True)
class Size:
    """How large a kind of thing is: each number lies between two, m."""

    kind: ThingKind
    length: tuple[float, float]
    width: tuple[float, float]
    height: tuple[float, float]

    def draw(self, rng: np.random.Generator, x: float, y: float, yaw: float) -> Thing:
        """One of them, at a place. A round one is as wide as it is long."""
        length, width, height = (
            float(rng.uniform(*bounds)) for bounds in (self.length, self.width, self.height)
        )
        thing = Thing(self.kind, x, y, yaw, length, width, height)
        return Thing(self.kind, x, y, 0.0, length, length, height) if thing.is_round else thing


@dataclass(frozen=True, slots=True)
class Lane:
    """A lane that is still empty.

    Attributes:
        route: Its middle, as that of a Course, (n, 2).
        left: Walls at its left hand.
        right: Walls at its right hand.
    """

    route: NDArray[np.float64]
    left: tuple[Wall, ...]
    right: tuple[Wall, ...]

    def half_width(self) -> NDArray[np.float64]:
        """Distance of each point of the route from the nearest wall, m, shape (n,)."""
        return to_segments(self.route, segments((*self.left, *self.right))).min(axis=1)


class Furniture:
    """The things in a lane. One that would close it is refused.

    Everything leaves its wider side free. Two that leave the same side free may stand close
    together; where a vehicle has to change sides between two, they are as far apart as the gap.

    Args:
        lane: Where they stand.
        half_width: What `lane.half_width()` said, (n,).
        gap_m: Narrowest way through that may be left, m.
    """

    def __init__(self, lane: Lane, half_width: NDArray[np.float64], gap_m: float) -> None:
        self.lane = lane
        self.half_width = half_width
        self.things: list[Thing] = []
        self.gap_m = 2.0 * float(half_width.min())
        """Narrowest way through that is left, m."""
        walls = (*lane.left, *lane.right)
        self._walls = segments(walls)
        self._lefts = len(lane.left)
        self._doors = np.array([wall.surface == "door" for wall in walls])
        self._wanted = gap_m
        self._round_m = length(lane.route)
        self._passed_left: list[bool] = []

    def offer(self, thing: Thing, s: float) -> bool:
        """Put a thing into the lane, if it fits.

        Args:
            thing: What, and where.
            s: How far along the route its middle is, m.

        Returns:
            Whether it stands there now.
        """
        reach = max(thing.length, thing.width) / 2.0
        s %= self._round_m
        if s - reach < FREE_AHEAD_M or self._round_m - s - reach < FREE_BEHIND_M:
            return False
        far = from_thing(thing, self._walls)
        left, right = float(far[: self._lefts].min()), float(far[self._lefts :].min())
        if min(left, right) <= 0.0 or max(left, right) < self._wanted:
            return False
        # Nobody puts a cabinet before a door.
        if (far[self._doors] < _BEFORE_DOORS_M).any():
            return False
        narrowest = max(left, right)
        passed_left = left >= right
        for other, other_left in zip(self.things, self._passed_left, strict=True):
            apart = between(thing, other)
            if passed_left == other_left:
                if apart <= 0.0:
                    return False
            elif apart < self._wanted + 0.1:
                return False
            else:
                narrowest = min(narrowest, apart)
        self.gap_m = min(self.gap_m, narrowest)
        self.things.append(thing)
        self._passed_left.append(passed_left)
        return True
