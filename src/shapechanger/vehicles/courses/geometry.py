"""Geometry of courses seen from above: closed lines, loops on a grid, distances, and progress.

Closed lines are arrays of points, m, (n, 2); the last point is joined to the first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.course import Course, Obstacle, Wall

Array = NDArray[np.float64]
"""Array of double precision numbers."""


def length(line: Array) -> float:
    """Length of a closed line, m."""
    return float(arc_lengths(line)[-1])


def arc_lengths(line: Array) -> Array:
    """Distances along a closed line to its points, then the length of the line, m, (n + 1,)."""
    steps = np.diff(line, axis=0, append=line[:1])
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])


def interpolate(line: Array, knots: Array, s: Array) -> Array:
    """Interpolate values at the points of a closed line, (n, k), at distances `s`, m, (j,): (j, k).

    `knots` are the `arc_lengths` of the line; distances wrap around.
    """
    whole = np.concatenate([line, line[:1]])
    s = np.mod(s, knots[-1])
    columns = [np.interp(s, knots, whole[:, k]) for k in range(whole.shape[1])]
    return np.stack(columns, axis=1)


def resample(line: Array, spacing: float) -> Array:
    """Resample a closed line, m, (n, 2), to points equally far apart, about `spacing` m."""
    knots = arc_lengths(line)
    n = max(8, round(float(knots[-1]) / spacing))
    s = even_distances(float(knots[-1]), n)
    # Equal arc lengths give unequal chords on a curve. After two corrections, chords differ by
    # a thousandth.
    for _ in range(2):
        chords = arc_lengths(interpolate(line, knots, s))
        s = np.interp(even_distances(float(chords[-1]), n), chords, np.append(s, knots[-1]))
    return interpolate(line, knots, s)


def even_distances(length_m: float, n: int) -> Array:
    """Evenly spaced distances from 0 along a closed line of this length, m, (n,)."""
    return np.arange(n, dtype=np.float64) * (length_m / n)


def smooth(values: Array, sigma: float) -> Array:
    """Values along a closed line, (n, ...), after a periodic Gaussian filter of `sigma` points."""
    n = len(values)
    waves = np.exp(-2.0 * (np.pi * sigma * np.fft.rfftfreq(n)) ** 2)
    spectrum = np.fft.rfft(values, axis=0)
    return np.fft.irfft(spectrum * waves.reshape(-1, *[1] * (values.ndim - 1)), n=n, axis=0)


def normals(line: Array) -> Array:
    """Unit vectors to the left of a closed line, (n, 2)."""
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    ahead /= np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    return np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)


def turn_angles(line: Array) -> Array:
    """Angle by which a closed line turns left at each point, rad, (n,)."""
    ahead = np.roll(line, -1, axis=0) - line
    back = np.roll(ahead, 1, axis=0)
    return np.arctan2(
        back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1)
    )


def tangent_radii(line: Array) -> Array:
    """Half width to which a lane around a closed line can grow before it overlaps itself, m, (n,).

    The half width at a point is the radius of the smallest circle that is tangent to the line there
    and passes through another point, like the global radius of curvature (Gonzalez, Maddocks, PNAS
    96, 1999).
    """
    x, y = line[:, 0] - line[:, :1], line[:, 1] - line[:, 1:]
    left = normals(line)
    squared = x * x + y * y
    across = np.abs(x * left[:, :1] + y * left[:, 1:])
    np.fill_diagonal(across, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        radii = np.where(across > 1e-9, squared / (2.0 * across), np.inf)
    return radii.min(axis=1)


Cell = tuple[int, int]
"""Column and row of a grid cell."""

_SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))


def random_loop(rng: np.random.Generator, size: int, pitch_m: tuple[float, float]) -> Array | None:
    """Draw a loop around `size` grid cells that are connected by their sides, m, (n, 2).

    Rows and columns have random widths in the range `pitch_m`. Returns None if the cells enclose a
    hole or touch only at a corner.
    """
    cells: set[Cell] = {(0, 0)}
    while len(cells) < size:
        around = sorted({(x + i, y + j) for x, y in cells for i, j in _SIDES} - cells)
        cells.add(around[int(rng.integers(len(around)))])
    loop = trace_outline(frozenset(cells))
    if loop is None:
        return None
    steps = rng.uniform(*pitch_m, size=(2, int(np.ptp(loop)) + 2))
    lines = np.cumsum(steps, axis=1)
    shifted = loop - loop.min(axis=0)
    return np.stack([lines[0, shifted[:, 0]], lines[1, shifted[:, 1]]], axis=1)


def trace_outline(cells: frozenset[Cell]) -> NDArray[np.int64] | None:
    """Grid points around a set of cells, counter-clockwise, one step apart, (n, 2).

    Returns None if the outline touches itself or has several parts, so that no lane can follow it.
    """
    edges: dict[Cell, Cell] = {}
    count = 0
    for x, y in cells:
        corners = ((x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1))
        for side, (i, j) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
            if (x + i, y + j) not in cells:
                edges[corners[side]] = corners[(side + 1) % 4]
                count += 1
    if len(edges) != count:  # Two edges start at the same point, where cells touch at a corner.
        return None
    first = min(edges)
    loop = [first]
    while (point := edges[loop[-1]]) != first:
        loop.append(point)
    return np.array(loop) if len(loop) == count else None


Segments = NDArray[np.float64]
"""Straight segments, m, (m, 4): x and y of the start, x and y of the end."""


def wall_segments(walls: Iterable[Wall]) -> Segments:
    """Return the segment on the ground below each wall."""
    return np.array([(*wall.start, *wall.end) for wall in walls], dtype=np.float64).reshape(-1, 4)


def distances_to_segments(points: Array, pieces: Segments) -> Array:
    """Distance of each point, m, (n, 2), from each segment: m, (n, m)."""
    x, y = points[:, 0:1] - pieces[:, 0], points[:, 1:2] - pieces[:, 1]
    dx, dy = pieces[:, 2] - pieces[:, 0], pieces[:, 3] - pieces[:, 1]
    share = np.clip((x * dx + y * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    x -= share * dx
    y -= share * dy
    return np.sqrt(x * x + y * y)  # Twice as fast as np.hypot, which guards against overflow.


def any_crossing(pieces: Segments) -> bool:
    """Return whether any two segments cross; a common end does not count."""
    start, along = pieces[:, :2], pieces[:, 2:] - pieces[:, :2]

    def side(points: Array) -> Array:
        """Return, for each segment (row) and point (column), > 0 if the point is to the left."""
        x, y = points[:, 0] - start[:, :1], points[:, 1] - start[:, 1:]
        hand = along[:, :1] * y - along[:, 1:] * x
        return np.where(np.abs(hand) < 1e-9, 0.0, hand)

    parted = side(pieces[:, :2]) * side(pieces[:, 2:]) < 0.0
    return bool((parted & parted.T).any())


_CORNERS: Final = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])


def distances_from_obstacle(obstacle: Obstacle, pieces: Segments) -> Array:
    """Distance of an obstacle from each segment, m, (m,); 0 or less if they overlap."""
    if obstacle.is_round:
        middle = np.array([[obstacle.x, obstacle.y]])
        return distances_to_segments(middle, pieces)[0] - obstacle.length / 2.0
    starts, ends = _into(obstacle, pieces[:, :2]), _into(obstacle, pieces[:, 2:])
    size = np.array([obstacle.length, obstacle.width])
    far = distances_to_segments(_CORNERS * size, np.concatenate([starts, ends], axis=1)).min(axis=0)
    for points in (pieces[:, :2], pieces[:, 2:]):
        far = np.minimum(far, _distances_from_points(obstacle, points))
    # A segment crosses the box if it enters both pairs of parallel sides before it leaves a pair.
    ahead = ends - starts
    ahead = np.where(np.abs(ahead) < 1e-12, 1e-12, ahead)
    low, high = (-size / 2.0 - starts) / ahead, (size / 2.0 - starts) / ahead
    enter, leave = np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)
    return np.where(np.maximum(enter, 0.0) < np.minimum(leave, 1.0), 0.0, far)


def obstacle_gap(one: Obstacle, other: Obstacle) -> float:
    """Distance between two obstacles, m; 0 or less if they overlap."""
    pairs = ((one, other), (other, one))
    for thing, round_one in pairs:
        if round_one.is_round:
            middle = np.array([[round_one.x, round_one.y]])
            return float(_distances_from_points(thing, middle)[0]) - round_one.length / 2.0
    return float(min(distances_from_obstacle(a, box_sides(b)).min() for a, b in pairs))


def box_sides(obstacle: Obstacle) -> Segments:
    """Sides of a box, counter-clockwise, m, (4, 4)."""
    corners = _CORNERS * np.array([obstacle.length, obstacle.width]) @ _axes(obstacle)
    corners += [obstacle.x, obstacle.y]
    return np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1)


def _distances_from_points(obstacle: Obstacle, points: Array) -> Array:
    """Distance of points, m, (n, 2), from an obstacle, m, (n,); 0 or less inside."""
    if obstacle.is_round:
        away = points - np.array([obstacle.x, obstacle.y])
        return np.hypot(away[:, 0], away[:, 1]) - obstacle.length / 2.0
    half = np.array([obstacle.length, obstacle.width]) / 2.0
    over = np.maximum(np.abs(_into(obstacle, points)) - half, 0.0)
    return np.hypot(over[:, 0], over[:, 1])


def _axes(obstacle: Obstacle) -> Array:
    """Unit vectors along an obstacle's length and width, as rows, (2, 2)."""
    c, s = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
    return np.array([[c, s], [-s, c]])


def _into(obstacle: Obstacle, points: Array) -> Array:
    """Points in the frame of an obstacle: along its length and along its width, m, (n, 2)."""
    return (points - np.array([obstacle.x, obstacle.y])) @ _axes(obstacle).T


FAR_M: Final = 2.5
"""Upper limit of reported distances, m."""

_CHUNK: Final = 256


class ClearanceField:
    """Distances from the walls and obstacles of a course, seen from above."""

    def __init__(self, course: Course) -> None:
        self._walls = wall_segments(course.walls)
        self._low = np.minimum(self._walls[:, :2], self._walls[:, 2:])
        self._high = np.maximum(self._walls[:, :2], self._walls[:, 2:])
        self._obstacles = course.obstacles

    def distance(self, points: Array) -> Array:
        """Distance of each point, m, (N, 2), from the nearest wall or obstacle, m, (N,).

        The distance is at most `FAR_M`, and 0 inside an obstacle. The computation is faster if
        successive points are close to each other.
        """
        parts = [self._near(points[i : i + _CHUNK]) for i in range(0, len(points), _CHUNK)]
        return np.concatenate([np.empty(0), *parts])

    def _near(self, points: Array) -> Array:
        low, high = points.min(axis=0) - FAR_M, points.max(axis=0) + FAR_M
        near = ((self._high >= low) & (self._low <= high)).all(axis=1)
        far = distances_to_segments(points, self._walls[near])
        found = far.min(axis=1, initial=FAR_M)
        for obstacle in self._obstacles:
            reach, here = obstacle.length + obstacle.width, np.array((obstacle.x, obstacle.y))
            if (here + reach >= low).all() and (here - reach <= high).all():
                found = np.minimum(found, _distances_from_points(obstacle, points))
        return np.maximum(found, 0.0)


# Distance along the line, m, within which the nearest spot is searched around a hint. Two parts of
# a course that are side by side are much farther apart along the line.
_WINDOW_M: Final = 2.0


class Spot(NamedTuple):
    """Position relative to a line."""

    station: float  # Distance along the line, m, from 0 to its length.
    lateral: float  # Distance from the line, m; positive to the left.


class ClosedLine:
    """Closed polyline of points, m, (N, 2); neighbours must differ."""

    def __init__(self, points: Array) -> None:
        self.points = points
        self._steps = np.roll(points, -1, axis=0) - points
        self._squared = np.einsum("ij,ij->i", self._steps, self._steps)
        lengths = np.sqrt(self._squared)
        # Distance of each point along the line, m, (N,), and length of the line, m.
        self.stations: Array = np.concatenate(([0.0], np.cumsum(lengths)[:-1]))
        self.length = float(lengths.sum())
        self._window = int(np.ceil(_WINDOW_M / (self.length / len(points))))
        # Arrays are extended by a window beyond both ends, so that each window is a slice.
        around = np.arange(-self._window, len(points) + self._window) % len(points)
        self._around = np.column_stack((points, self._steps, self._squared))[around].T.copy()

    def index(self, station: float) -> int:
        """Index of the last point at or before a station, m; stations wrap around."""
        return int(np.searchsorted(self.stations, station % self.length, side="right")) - 1

    def at(self, station: float) -> tuple[float, float]:
        """Point, m, at a station, m; stations wrap around."""
        i = self.index(station)
        share = (station % self.length - self.stations[i]) / np.sqrt(self._squared[i])
        x, y = self.points[i] + share * self._steps[i]
        return float(x), float(y)

    def nearest(self, x: float, y: float, hint: float | None = None) -> Spot:
        """Spot of the line nearest to a point, m; with a hint, only near that station."""
        if hint is None:
            first, count = 0, len(self.points)
        else:
            first, count = self.index(hint) - self._window, 2 * self._window + 1
        # Each control step calls this function, so it uses few and small arrays.
        near = self._around[:, first + self._window : first + self._window + count]
        start_x, start_y, step_x, step_y, squared = near
        away_x, away_y = x - start_x, y - start_y
        share = (away_x * step_x + away_y * step_y) / squared
        np.maximum(np.minimum(share, 1.0, out=share), 0.0, out=share)
        off_x, off_y = away_x - share * step_x, away_y - share * step_y
        best = int((off_x * off_x + off_y * off_y).argmin())
        behind = self.stations[(first + best) % len(self.points)]
        station = float(behind + share[best] * np.sqrt(squared[best])) % self.length
        cross = float(step_x[best] * away_y[best] - step_y[best] * away_x[best])
        return Spot(station, math.copysign(math.hypot(off_x[best], off_y[best]), cross))

    def ahead_by(self, start: float, end: float) -> float:
        """Length of the shorter way from one station to another, m; negative if backwards."""
        return (end - start + self.length / 2) % self.length - self.length / 2


class CourseProgress:
    """Measures a vehicle's net distance along a route over all laps; driving back reduces it.

    Call `reset` first, and whenever the vehicle moves by more than 2 m at once.
    """

    def __init__(self, course: Course) -> None:
        self._line = ClosedLine(course.route)

    def reset(self, x: float, y: float) -> None:
        """Start at a point, m."""
        self._station = self._line.nearest(x, y).station
        self._metres = 0.0

    def update(self, x: float, y: float) -> float:
        """Move the vehicle to a point, and return the net distance since the last reset, m."""
        before = self._station
        self._station = self._line.nearest(x, y, before).station
        self._metres += self._line.ahead_by(before, self._station)
        return self._metres
