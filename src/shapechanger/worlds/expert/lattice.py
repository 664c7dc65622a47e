"""How far points are from whatever stands in a course."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import WorldError
from shapechanger.worlds.course import Course
from shapechanger.worlds.expert.line import ClosedLine

__all__ = ["FAR_M", "ClearanceField", "Lattice", "cheapest_way", "lay_lattice"]

FAR_M: Final = 2.5
"""Distances are exact up to here and given as this beyond: nobody drives by what is farther."""

_CHUNK: Final = 256


class ClearanceField:
    """The walls and things of a course, seen from above.

    Args:
        course: What they stand in.
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
        """Distance of each point from the nearest wall or thing, m, at most `FAR_M`; 0 inside.

        It is fast where neighbours in the array are neighbours in the course.

        Args:
            points: (N, 2), m.

        Returns:
            (N,).
        """
        parts = [self._near(points[i : i + _CHUNK]) for i in range(0, max(len(points), 1), _CHUNK)]
        return np.concatenate(parts)

    def _near(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """As `distance`, for points that lie close together."""
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
        """Distance of each point from the nearest wall that reaches into a rectangle."""
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
        """As `_from_walls`, of boxes."""
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
        """As `_from_walls`, of cylinders."""
        reach = self._round[:, 2:]
        near = (self._round[:, :2] + reach >= low) & (self._round[:, :2] - reach <= high)
        x, y, radius = self._round[near.all(axis=1)].T[:, :, None]
        off = np.hypot(points[:, 0] - x, points[:, 1] - y) - radius
        return np.maximum(off, 0.0).min(axis=0, initial=FAR_M)


STATION_M: Final = 0.2
OFFSET_M: Final = 0.1

SLOPES: Final = np.arange(-2, 3)
"""Offsets that a way may gain from one station to the next, in steps of `OFFSET_M`."""

BEND_COST: Final = 0.15
"""Of changing the slope by one."""

SLANT_COST: Final = 0.02
"""Of a slope of one."""

NARROW_COST: Final = 1.0
"""Of a point whose clearance is the smallest allowed; it grows with the square of what is missing
to a comfortable one."""

OVERLAP_M: Final = 12.0
"""How far ways are searched beyond a whole lap. Where a way is now no longer depends on where it
was that long ago, so a lap cut out of the middle closes."""


@dataclass(frozen=True, slots=True)
class Lattice:
    """Points across the lane at stations along it.

    Attributes:
        middle: (N, 2) of the lane, m.
        left: (N, 2) unit vectors to the left.
        offsets: (K,) m, positive to the left.
        clearance: (N, K) m; 0 where a point is no part of the lane.
    """

    middle: NDArray[np.float64]
    left: NDArray[np.float64]
    offsets: NDArray[np.float64]
    clearance: NDArray[np.float64]


def lay_lattice(course: Course, obstacles: ClearanceField) -> Lattice:
    """Lay points over the lane of a course.

    Args:
        course: Where.
        obstacles: What stands there.
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
    # The direction over 0.8 m: a sharper look would let the rows cross each other in tight corners.
    ahead = np.roll(middle, -2, axis=0) - np.roll(middle, 2, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
    side = int(np.floor(half_width.max() / OFFSET_M))
    offsets = np.linspace(-side, side, 2 * side + 1) * OFFSET_M
    points = middle[:, None] + offsets[None, :, None] * left[:, None]
    clearance = obstacles.distance(points.reshape(-1, 2)).reshape(points.shape[:2])
    clearance[np.abs(offsets)[None, :] > half_width[:, None]] = 0.0
    # Inside a corner, beyond its centre, the rows run backward: nobody can drive there.
    gained = np.einsum("ikj,ij->ik", np.roll(points, -1, axis=0) - points, ahead)
    backward = gained < 0.2 * step
    clearance[backward | np.roll(backward, 1, axis=0)] = 0.0
    return Lattice(middle, left, offsets, clearance)


def cheapest_way(lattice: Lattice, least_m: float, comfort_m: float) -> NDArray[np.int64]:
    """The closed way that bends least and keeps away from what is in the way.

    Dynamic programming over stations; what is remembered of a way is its offset and its slope.

    Args:
        lattice: Where.
        least_m: Clearance that no point of the way may miss, m.
        comfort_m: Clearance beyond which more is not worth a bend, m.

    Returns:
        (N,) numbers of the offsets, one a station.

    Raises:
        WorldError: There is no such way.
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
    """The cheapest way along stations.

    Args:
        cost: (N, K) of being at each offset.
        stations: (M,) which of the N, in order.
        seam: The offset to begin and to end with; None leaves both free.
        least_m: For the words of the error.

    Returns:
        (M,).

    Raises:
        WorldError: There is none.
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
                f"Nothing that needs {2 * least_m:.2f} m gets through this course: it is blocked "
                f"{station * STATION_M:.0f} m from its start. Use a narrower vehicle, a smaller "
                "margin, or another seed."
            )
    if seam is not None:
        total[np.arange(width) != seam] = np.inf
        if not np.isfinite(total).any():
            raise WorldError(
                f"No way round this course with {2 * least_m:.2f} m of room comes back to where "
                "it began. Use a smaller margin, or another seed."
            )
    offset, slope = np.unravel_index(int(np.argmin(total)), total.shape)
    way = np.empty(len(stations), np.int64)
    for row in range(len(stations) - 1, -1, -1):
        way[row] = offset
        before = came_from[row, offset, slope] if row else 0
        offset, slope = offset - SLOPES[slope], before
    return way
