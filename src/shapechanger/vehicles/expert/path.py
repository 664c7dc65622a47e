"""Planning of a smooth, collision-free path around a course.

The cheapest way through a lattice decides on which side to pass each obstacle. The path is the
least bent line between bounds around this way. The points of a line are `middle + offset * left`,
so the sum of its squared second differences is a quadratic function of the offsets, and the best
offsets solve a convex problem. Racing lines are computed like this: F. Braghin et al., "Race driver
model", Computers and Structures 86 (2008); A. Heilmeier et al., "Minimum curvature trajectory
planning", Vehicle System Dynamics 58 (2020).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from shapechanger.errors import WorldError
from shapechanger.vehicles.courses.course import Course
from shapechanger.vehicles.courses.geometry import Array, ClearanceField, ClosedLine, arc_lengths

_STATION_M: Final = 0.2
_OFFSET_M: Final = 0.1
_SLOPES: Final = np.arange(-2, 3)  # Changes of the offset between stations, in `_OFFSET_M`.
# Costs of changing the slope by one, of a slope of one, and of a point with the smallest allowed
# clearance. The last cost is quadratic in the clearance that a point lacks.
_BEND_COST: Final = 0.15
_SLANT_COST: Final = 0.02
_NARROW_COST: Final = 1.0
# Length of the search beyond a whole lap, m. Six metres after the start, the way hardly depends on
# the first offset, so the lap from there on is closed.
_OVERLAP_M: Final = 12.0
# A relaxation of 1.5 to 1.8 converges faster than 1 (S. Boyd et al., "Distributed Optimization and
# Statistical Learning via the Alternating Direction Method of Multipliers", 2011, section 3.4.3).
_ROUNDS: Final = 150
_RELAXATION: Final = 1.6
_SPACING_M: Final = 0.1  # Approximate distance between the points of a path.
# Weight of preferred offsets, 1/m^4: `1 / sqrt(_PULL)` m off costs as much as a curvature of 1/m.
_PULL: Final = 0.02
_ATTEMPTS: Final = 8  # Largest number of attempts to move a line away from obstacles.


class _Lattice:
    """Points across the lane of a course, K at each of N stations, and ways through the points.

    A vehicle's path has a clearance of at least `least_m`, and prefers `comfort_m`.
    """

    def __init__(self, course: Course, least_m: float, comfort_m: float) -> None:
        self._least_m, self._comfort_m = least_m, comfort_m
        self._obstacles = obstacles = ClearanceField(course)
        line = ClosedLine(course.route)
        count = max(round(line.length / _STATION_M), 8)
        middle = np.array([line.at(line.length * i / count) for i in range(count)])
        step = line.length / count
        at_m = np.arange(count) * line.length / count
        half_width = np.interp(at_m, line.stations, course.half_width, period=line.length)
        # Directions are averaged over 0.8 m; otherwise rows would cross in tight corners.
        ahead = np.roll(middle, -2, axis=0) - np.roll(middle, 2, axis=0)
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
        side = int(np.floor(half_width.max() / _OFFSET_M))
        offsets = np.linspace(-side, side, 2 * side + 1) * _OFFSET_M
        points = middle[:, None] + offsets[None, :, None] * left[:, None]
        clearance = obstacles.distance(points.reshape(-1, 2)).reshape(points.shape[:2])
        clearance[np.abs(offsets)[None, :] > half_width[:, None]] = 0.0
        # Beyond the centre of a corner, rows run backward; such points are outside the lane.
        gained = np.einsum("ikj,ij->ik", np.roll(points, -1, axis=0) - points, ahead)
        backward = gained < 0.2 * step
        clearance[backward | np.roll(backward, 1, axis=0)] = 0.0
        self._middle, self._left = middle, left  # m, and unit vectors to the left, (N, 2).
        self._offsets, self._clearance = offsets, clearance  # m, (K,) and (N, K).

    def path(self, spare_m: float) -> CoursePath | None:
        """Return a smooth path along the cheapest way, or None if smoothing fails.

        Points with a clearance below the least clearance plus `spare_m` are forbidden. Raises a
        `WorldError` if there is no way.
        """
        least_m = self._least_m + spare_m
        comfort_m = max(self._comfort_m, self._least_m + 0.05)
        missing = np.clip((comfort_m - self._clearance) / max(comfort_m - least_m, 1e-9), 0.0, 1.0)
        cost = np.where(self._clearance >= least_m, _NARROW_COST * missing**2, np.inf)
        count = len(cost)
        overlap = min(round(_OVERLAP_M / _STATION_M), count)
        way = _search(cost, np.arange(count + overlap) % count, None, least_m)
        seam = overlap // 2
        if way[seam] != way[seam + count]:
            stations = (np.arange(count + 1) + seam) % count
            closed = _search(cost, stations, int(way[seam + count]), least_m)
            return self._smoothed(np.roll(closed[:-1], seam))
        return self._smoothed(np.roll(way[seam : seam + count], seam))

    def _smoothed(self, way: NDArray[np.int64]) -> CoursePath | None:
        """Return a smooth path with all obstacles on the same sides as on a way, or None."""
        extra = np.zeros(len(way))
        for _ in range(_ATTEMPTS):
            low, high = self._room(way, extra)
            offsets = _least_bent(self._middle, self._left, low, high, self._offsets[way])
            path = CoursePath(self._middle + offsets[:, None] * self._left, self._obstacles)
            short = self._least_m - path.clearance
            if short.max() <= 0:
                return path
            # Increase the clearance where it is too small, and try again.
            knots = np.arange(len(path.points)) * len(way) // len(path.points)
            need = np.zeros(len(way))
            np.maximum.at(need, knots, np.maximum(short, 0.0))
            for shift in (-2, -1, 1, 2):
                need = np.maximum(need, np.roll(need, shift))
            extra += 1.2 * need + 0.005 * (need > 0)
        return None

    def _room(self, way: NDArray[np.int64], extra: Array) -> tuple[Array, Array]:
        """Bounds of the offset at each station, m, with the preferred clearance where it fits."""
        low, high = np.empty(len(way)), np.empty(len(way))
        for i, k in enumerate(way):
            # The bounds always include the offset of the way.
            clear = float(self._clearance[i, k])
            least = self._least_m + extra[i]
            wanted = min(max(self._comfort_m, least), clear - 0.02 + extra[i])
            wanted = min(max(wanted, least), clear)
            low[i], high[i] = (self._edge(i, int(k), side, wanted) for side in (-1, 1))
        return low, high

    def _edge(self, i: int, k: int, side: int, wanted: float) -> float:
        """Offset to one side of point k at which the clearance falls below `wanted`, m."""
        clearance, offsets = self._clearance[i], self._offsets
        beyond = k + side
        while 0 <= beyond < len(offsets) and clearance[beyond] >= wanted:
            k, beyond = beyond, beyond + side
        here = float(offsets[k])
        if not 0 <= beyond < len(offsets):
            return here
        inside, outside = float(clearance[k]), float(clearance[beyond])
        if outside == 0.0 or inside <= wanted or outside >= inside:
            return here  # A clearance of 0 may mean a point outside the lane.
        share = (inside - wanted) / (inside - outside)
        return here + min(share, 1.0) * (float(offsets[beyond]) - here)


def _search(
    cost: Array, stations: NDArray[np.int64], seam: int | None, least_m: float
) -> NDArray[np.int64]:
    """Return the cheapest way along stations, (M,), as indices of offsets, (M,); cost is (N, K).

    The state of the dynamic programming is offset and slope. `seam` is the index of the first and
    last offset; None for any.
    """
    width = cost.shape[1]
    bends = _BEND_COST * (_SLOPES[:, None] - _SLOPES[None, :]) ** 2  # (from, to)
    slants = _SLANT_COST * _SLOPES**2
    total = np.full((width, len(_SLOPES)), np.inf)
    total[:] = cost[stations[0]][:, None]
    if seam is not None:
        total[np.arange(width) != seam] = np.inf
    came_from = np.empty((len(stations), width, len(_SLOPES)), np.int8)
    for row, station in enumerate(stations[1:], start=1):
        turned = total[:, :, None] + bends  # (offset, slope before, slope after)
        chosen = turned.argmin(axis=1)
        best = np.take_along_axis(turned, chosen[:, None, :], axis=1)[:, 0, :] + slants
        total = np.full_like(total, np.inf)
        for slope, gain in enumerate(_SLOPES):
            # From offset k to k + gain.
            to = slice(max(gain, 0), width + min(gain, 0))
            of = slice(max(-gain, 0), width + min(-gain, 0))
            total[to, slope] = best[of, slope] + cost[station, to]
            came_from[row, to, slope] = chosen[of, slope]
        if not np.isfinite(total).any():
            raise WorldError(
                f"The course is blocked for anything {2 * least_m:.2f} m wide "
                f"{station * _STATION_M:.0f} m from its start: use another seed."
            )
    if seam is not None:
        total[np.arange(width) != seam] = np.inf
        if not np.isfinite(total).any():
            raise WorldError(
                f"No way around this course is {2 * least_m:.2f} m wide: use another seed."
            )
    offset, slope = np.unravel_index(int(np.argmin(total)), total.shape)
    way = np.empty(len(stations), np.int64)
    for row in range(len(stations) - 1, -1, -1):
        way[row] = offset
        before = came_from[row, offset, slope] if row else 0
        offset, slope = offset - _SLOPES[slope], before
    return way


def _least_bent(middle: Array, left: Array, low: Array, high: Array, wish: Array) -> Array:
    """Return the offsets of the least bent closed line between bounds; `wish` are preferred ones.

    The alternating direction method approximates the solution, and an active-set step refines it.
    SciPy's `lsq_linear` takes 3.7 times as long for lines of a course's size.
    """
    count = len(middle)
    step = float(np.linalg.norm(np.roll(middle, -1, axis=0) - middle, axis=1).mean())
    one = np.eye(count)
    bend = (np.roll(one, 1, axis=1) + np.roll(one, -1, axis=1) - 2 * one) / step**2
    gram = bend.T @ bend
    quadratic = gram * (left @ left.T) + _PULL * one
    linear = np.einsum("ij,ij->i", left, gram @ middle) - _PULL * wish
    # Alternating direction method in scaled form: a step without bounds, then a projection.
    weight = 10.0 * _PULL + 1.0
    inverse = np.linalg.inv(quadratic + weight * one)
    bounded = np.clip(wish, low, high)
    debt = np.zeros(count)
    for _ in range(_ROUNDS):
        free = inverse @ (weight * (bounded - debt) - linear)
        free = _RELAXATION * free + (1 - _RELAXATION) * bounded
        bounded = np.clip(free + debt, low, high)
        debt += free - bounded
    # Exact solution for the points that are not on a bound.
    moves = (bounded > low + 1e-6) & (bounded < high - 1e-6)
    if moves.any():
        fixed = quadratic[np.ix_(moves, ~moves)] @ bounded[~moves]
        bounded[moves] = np.linalg.solve(quadratic[np.ix_(moves, moves)], -linear[moves] - fixed)
    return np.clip(bounded, low, high)


class CoursePath(ClosedLine):
    """A closed, evenly spaced path: a periodic cubic spline through `knots`, m, (n, 2).

    At each of the N points, `heading` is the direction, rad, counter-clockwise from the x axis;
    `curvature`, 1/m, is positive to the left; `clearance` is the distance to walls or obstacles, m.
    """

    def __init__(self, knots: Array, obstacles: ClearanceField) -> None:
        chords = arc_lengths(knots)
        spline = CubicSpline(chords, np.vstack((knots, knots[:1])), bc_type="periodic")
        # Even steps of the parameter are only approximately even along the line.
        around = float(chords[-1])
        count = max(round(around / _SPACING_M), 8)
        fine = np.linspace(0.0, around, 4 * count + 1)
        arcs = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(spline(fine), axis=0).T))))
        even = np.linspace(0.0, float(arcs[-1]), count, endpoint=False)
        where = np.interp(even, arcs, fine)
        points, first, second = spline(where), spline(where, 1), spline(where, 2)
        super().__init__(points)
        speed = np.hypot(first[:, 0], first[:, 1])
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        self.heading: Array = np.arctan2(first[:, 1], first[:, 0])
        self.curvature: Array = cross / speed**3
        self.clearance = obstacles.distance(points)


def plan_path(
    course: Course, half_width_m: float, margin_m: float, *, comfort_m: float
) -> CoursePath:
    """Plan a smooth path around a course, or raise a `WorldError` if there is no path.

    The path keeps a clearance of `margin_m` on each side of the vehicle, and prefers `comfort_m`.
    """
    lattice = _Lattice(course, half_width_m + margin_m, half_width_m + comfort_m)
    # A line between two lattice points may come closer to obstacles, so first try extra clearance.
    for spare in (0.03, 0.0):
        try:
            path = lattice.path(spare)
        except WorldError:
            if not spare:
                raise
            continue
        if path is not None:
            return path
    raise WorldError(
        f"No smooth path through the {course.world} with seed {course.seed} leaves "
        f"{margin_m:.2f} m on each side of a vehicle {2 * half_width_m:.2f} m wide: use another "
        "seed."
    )
