"""The cheapest way around a course on a lattice of points, and clearances from obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import WorldError
from shapechanger.worlds.course import Course
from shapechanger.worlds.expert.line import ClosedLine

FAR_M: Final = 2.5
"""Largest distance that is computed, m; larger ones are reported as this."""

_CHUNK: Final = 256


class ClearanceField:
    """Distances from the walls and obstacles of a course, seen from above.

    Args:
        course: The course.
    """

    def __init__(self, course: Course) -> None:
        walls = np.array([(*w.start, *w.end) for w in course.walls], np.float64).reshape(-1, 4)
        self._start, self._step = walls[:, :2], walls[:, 2:] - walls[:, :2]
        self._squared = np.maximum(np.einsum("ij,ij->i", self._step, self._step), 1e-12)
        boxes = [t for t in course.obstacles if not t.is_round]
        rounds = [t for t in course.obstacles if t.is_round]
        self._box = np.array(
            [(t.x, t.y, np.cos(t.yaw), np.sin(t.yaw), t.length / 2, t.width / 2) for t in boxes],
            np.float64,
        ).reshape(-1, 6)
        self._round = np.array([(t.x, t.y, t.length / 2) for t in rounds], np.float64)
        self._round = self._round.reshape(-1, 3)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of each point from the nearest wall or obstacle, m, (N,).

        It is at most `FAR_M`, and 0 inside an obstacle. It is fast if neighbours in the array are
        close to each other.

        Args:
            points: Points, m, (N, 2).
        """
        parts = [self._near(points[i : i + _CHUNK]) for i in range(0, max(len(points), 1), _CHUNK)]
        return np.concatenate(parts)

    def _near(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances of points that are close together."""
        found = np.full(len(points), FAR_M)
        if not len(points):
            return found
        low, high = points.min(axis=0) - FAR_M, points.max(axis=0) + FAR_M
        found = np.minimum(found, self._from_walls(points, low, high))
        found = np.minimum(found, self._from_boxes(points, low, high))
        return np.minimum(found, self._from_rounds(points, low, high))

    def _from_walls(
        self, points: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distances from the walls that reach into a rectangle."""
        end = self._start + self._step
        near = (np.maximum(self._start, end) >= low) & (np.minimum(self._start, end) <= high)
        near = near.all(axis=1)
        step = self._step[near][:, None]
        away = points - self._start[near][:, None]  # (walls, points, 2)
        share = np.einsum("wpj,wpj->wp", away, np.broadcast_to(step, away.shape))
        share = np.clip(share / self._squared[near][:, None], 0.0, 1.0)
        away -= share[:, :, None] * step
        squared = np.einsum("wpj,wpj->wp", away, away)
        return np.sqrt(squared.min(axis=0, initial=FAR_M**2))

    def _from_boxes(
        self, points: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distances from the boxes that reach into a rectangle."""
        reach = (self._box[:, 4] + self._box[:, 5])[:, None]
        near = (self._box[:, :2] + reach >= low) & (self._box[:, :2] - reach <= high)
        x, y, cos, sin, half_length, half_width = self._box[near.all(axis=1)].T[:, :, None]
        dx, dy = points[:, 0] - x, points[:, 1] - y
        along = np.maximum(np.abs(cos * dx + sin * dy) - half_length, 0.0)
        across = np.maximum(np.abs(cos * dy - sin * dx) - half_width, 0.0)
        return np.hypot(along, across).min(axis=0, initial=FAR_M)

    def _from_rounds(
        self, points: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distances from the cylinders that reach into a rectangle."""
        reach = self._round[:, 2:]
        near = (self._round[:, :2] + reach >= low) & (self._round[:, :2] - reach <= high)
        x, y, radius = self._round[near.all(axis=1)].T[:, :, None]
        off = np.hypot(points[:, 0] - x, points[:, 1] - y) - radius
        return np.maximum(off, 0.0).min(axis=0, initial=FAR_M)


STATION_M: Final = 0.2
OFFSET_M: Final = 0.1

SLOPES: Final = np.arange(-2, 3)
"""Changes of the offset from one station to the next, in steps of `OFFSET_M`."""

BEND_COST: Final = 0.15
"""Cost of changing the slope by one."""

SLANT_COST: Final = 0.02
"""Cost of a slope of one."""

NARROW_COST: Final = 1.0
"""Cost of a point with the smallest allowed clearance; it is quadratic in what is missing to the
preferred clearance."""

OVERLAP_M: Final = 12.0
"""Length of the search beyond a whole lap, m. A way hardly depends on its offset that far back, so
that a lap cut from the middle is closed."""


@dataclass(frozen=True, slots=True)
class Lattice:
    """Rows of points across the lane, at stations along it.

    Attributes:
        middle: Middle of the lane, m, (N, 2).
        left: Unit vectors to the left, (N, 2).
        offsets: Offsets from the middle, m, positive to the left, (K,).
        clearance: Clearance of each point, m, (N, K); 0 outside the lane.
    """

    middle: NDArray[np.float64]
    left: NDArray[np.float64]
    offsets: NDArray[np.float64]
    clearance: NDArray[np.float64]


def lay_lattice(course: Course, obstacles: ClearanceField) -> Lattice:
    """Lay a lattice over the lane of a course.

    Args:
        course: The course.
        obstacles: Its clearances.
    """
    line = ClosedLine(course.route)
    count = max(round(line.length / STATION_M), 8)
    middle = np.array([line.at(line.length * i / count) for i in range(count)])
    half_width = np.interp(
        np.arange(count) * line.length / count,
        line.stations,
        course.half_width,
        period=line.length,
    )
    step = line.length / count
    # The direction over 0.8 m; rows would cross each other in tight corners with a shorter one.
    ahead = np.roll(middle, -2, axis=0) - np.roll(middle, 2, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
    side = int(np.floor(half_width.max() / OFFSET_M))
    offsets = np.linspace(-side, side, 2 * side + 1) * OFFSET_M
    points = middle[:, None] + offsets[None, :, None] * left[:, None]
    clearance = obstacles.distance(points.reshape(-1, 2)).reshape(points.shape[:2])
    clearance[np.abs(offsets)[None, :] > half_width[:, None]] = 0.0
    # Beyond the centre of a corner, rows run backward; such points are outside the lane.
    gained = np.einsum("ikj,ij->ik", np.roll(points, -1, axis=0) - points, ahead)
    backward = gained < 0.2 * step
    clearance[backward | np.roll(backward, 1, axis=0)] = 0.0
    return Lattice(middle, left, offsets, clearance)


def cheapest_way(lattice: Lattice, least_m: float, comfort_m: float) -> NDArray[np.int64]:
    """The closed way with the least cost of bends and narrow passages.

    It is found by dynamic programming over stations, with offset and slope as the state.

    Args:
        lattice: The lattice.
        least_m: Smallest clearance, m.
        comfort_m: Clearance above which more is worth nothing, m.

    Returns:
        Index of the offset at each station, (N,).

    Raises:
        WorldError: If there is no such way.
    """
    missing = np.clip((comfort_m - lattice.clearance) / max(comfort_m - least_m, 1e-9), 0.0, 1.0)
    cost = np.where(lattice.clearance >= least_m, NARROW_COST * missing**2, np.inf)
    count = len(cost)
    overlap = min(round(OVERLAP_M / STATION_M), count)
    way = _search(cost, np.arange(count + overlap) % count, None, least_m)
    seam = overlap // 2
    if way[seam] != way[seam + count]:
        stations = (np.arange(count + 1) + seam) % count
        closed = _search(cost, stations, int(way[seam + count]), least_m)
        return np.roll(closed[:-1], seam)
    return np.roll(way[seam : seam + count], seam)


def _search(
    cost: NDArray[np.float64], stations: NDArray[np.int64], seam: int | None, least_m: float
) -> NDArray[np.int64]:
    """The cheapest way along stations, as indices of offsets, (M,).

    Args:
        cost: Cost of each offset, (N, K).
        stations: Stations to visit, in order, (M,).
        seam: Offset to start and end with; None leaves both free.
        least_m: Smallest clearance, m, for error messages.

    Raises:
        WorldError: If there is no way.
    """
    width = cost.shape[1]
    bends = BEND_COST * (SLOPES[:, None] - SLOPES[None, :]) ** 2  # (from, to)
    slants = SLANT_COST * SLOPES**2
    total = np.full((width, len(SLOPES)), np.inf)
    total[:] = cost[stations[0]][:, None]
    if seam is not None:
        total[np.arange(width) != seam] = np.inf
    came_from = np.empty((len(stations), width, len(SLOPES)), np.int8)
    for row, station in enumerate(stations[1:], start=1):
        turned = total[:, :, None] + bends  # (offset, slope before, slope after)
        chosen = turned.argmin(axis=1)
        best = np.take_along_axis(turned, chosen[:, None, :], axis=1)[:, 0, :] + slants
        total = np.full_like(total, np.inf)
        for slope, gain in enumerate(SLOPES):
            # From offset k to k + gain.
            to = slice(max(gain, 0), width + min(gain, 0))
            of = slice(max(-gain, 0), width + min(-gain, 0))
            total[to, slope] = best[of, slope] + cost[station, to]
            came_from[row, to, slope] = chosen[of, slope]
        if not np.isfinite(total).any():
            raise WorldError(
                f"The course is blocked for anything {2 * least_m:.2f} m wide "
                f"{station * STATION_M:.0f} m from its start. Use a narrower vehicle, a smaller "
                "margin, or another seed."
            )
    if seam is not None:
        total[np.arange(width) != seam] = np.inf
        if not np.isfinite(total).any():
            raise WorldError(
                f"No way around this course with a width of {2 * least_m:.2f} m returns to its "
                "start. Use a smaller margin, or another seed."
            )
    offset, slope = np.unravel_index(int(np.argmin(total)), total.shape)
    way = np.empty(len(stations), np.int64)
    for row in range(len(stations) - 1, -1, -1):
        way[row] = offset
        before = came_from[row, offset, slope] if row else 0
        offset, slope = offset - SLOPES[slope], before
    return way
