"""Closed lines as arrays of points, shape (n, 2), in metres: the last is joined to the first."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Obstacle, Wall

__all__ = [
    "Cell",
    "any_crossing",
    "arc_lengths",
    "box_sides",
    "distances_from_obstacle",
    "distances_to_segments",
    "even_distances",
    "grow_cells",
    "interpolate",
    "length",
    "normals",
    "obstacle_gap",
    "resample",
    "scale_grid",
    "smooth",
    "tangent_radii",
    "trace_outline",
    "turn_angles",
    "wall_segments",
]

Points = NDArray[np.float64]


def length(line: Points) -> float:
    """Once round, m."""
    return float(arc_lengths(line)[-1])


def arc_lengths(line: Points) -> NDArray[np.float64]:
    """Distance along the line to each point and, as the last number, once round; shape (n + 1,)."""
    steps = np.diff(line, axis=0, append=line[:1])
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])


def interpolate(
    line: NDArray[np.float64], knots: NDArray[np.float64], s: NDArray[np.float64]
) -> Points:
    """Values at distances `s` along a closed line, between its points linearly.

    Args:
        line: Values at the points, shape (n, k).
        knots: What `arc_lengths` says of the points, shape (n + 1,).
        s: Distances, m, of any size: they wrap round. Shape (m,).

    Returns:
        Shape (m, k).
    """
    whole = np.concatenate([line, line[:1]])
    s = np.mod(s, knots[-1])
    columns = [np.interp(s, knots, whole[:, k]) for k in range(whole.shape[1])]
    return np.stack(columns, axis=1)


def resample(line: Points, spacing: float) -> Points:
    """The line by points that are about `spacing` apart: all the same distance, as the crow flies.

    Equal distances along a bent line are unequal as the crow flies; two corrections make the rest
    of the difference smaller than a part in a thousand on the bends that vehicles can drive.
    """
    knots = arc_lengths(line)
    n = max(8, round(float(knots[-1]) / spacing))
    s = even_distances(float(knots[-1]), n)
    for _ in range(2):
        chords = arc_lengths(interpolate(line, knots, s))
        s = np.interp(even_distances(float(chords[-1]), n), chords, np.append(s, knots[-1]))
    return interpolate(line, knots, s)


def even_distances(length_m: float, n: int) -> NDArray[np.float64]:
    """So many distances from 0 on, evenly over a closed line of that length, m, shape (n,)."""
    return np.arange(n, dtype=np.float64) * (length_m / n)


def smooth(values: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Columns of a closed line, blurred by a bell curve of `sigma` points. Shape as given."""
    n = len(values)
    waves = np.exp(-2.0 * (np.pi * sigma * np.fft.rfftfreq(n)) ** 2)
    spectrum = np.fft.rfft(values, axis=0)
    return np.fft.irfft(spectrum * waves.reshape(-1, *[1] * (values.ndim - 1)), n=n, axis=0)


def normals(line: Points) -> Points:
    """Unit vectors to the left of the line at its points, shape (n, 2)."""
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    ahead /= np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    return np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)


def turn_angles(line: Points) -> NDArray[np.float64]:
    """By how much the line turns to the left at each point, rad, shape (n,)."""
    ahead = np.roll(line, -1, axis=0) - line
    back = np.roll(ahead, 1, axis=0)
    return np.arctan2(
        back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], (back * ahead).sum(axis=1)
    )


def tangent_radii(line: Points) -> NDArray[np.float64]:
    """How far a lane can spread to both sides of each point before it meets itself, m, shape (n,).

    It is the radius of the smallest circle that touches the line at the point and goes through
    another: small in a tight bend, and where another part of the line comes near. Gonzalez and
    Maddocks call its like the global radius of curvature (PNAS 96, 1999, pages 4769-4773).
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
"""Column and row of a square."""

_SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))


def grow_cells(rng: np.random.Generator, size: int) -> frozenset[Cell]:
    """`size` squares that hang together by their sides, grown one by one from the first.

    The set may have holes and squares that touch by a corner only; `trace_outline` refuses those.
    """
    cells: set[Cell] = {(0, 0)}
    while len(cells) < size:
        around = sorted({(x + i, y + j) for x, y in cells for i, j in _SIDES} - cells)
        cells.add(around[int(rng.integers(len(around)))])
    return frozenset(cells)


def trace_outline(cells: frozenset[Cell]) -> NDArray[np.int64] | None:
    """Grid points round the squares, counter-clockwise, each one step from the next, shape (n, 2).

    None where the outline meets itself or is in several pieces: no lane could follow it.
    """
    edges: dict[Cell, Cell] = {}
    count = 0
    for x, y in cells:
        corners = ((x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1))
        for side, (i, j) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
            if (x + i, y + j) not in cells:
                edges[corners[side]] = corners[(side + 1) % 4]
                count += 1
    if len(edges) != count:  # Two edges leave one point: squares touch by a corner.
        return None
    first = min(edges)
    loop = [first]
    while (point := edges[loop[-1]]) != first:
        loop.append(point)
    return np.array(loop) if len(loop) == count else None


def scale_grid(
    rng: np.random.Generator, loop: NDArray[np.int64], shortest_m: float, longest_m: float
) -> NDArray[np.float64]:
    """The loop in metres, each row and column of the grid as wide as chance wills, shape (n, 2)."""
    steps = rng.uniform(shortest_m, longest_m, size=(2, int(np.ptp(loop)) + 2))
    lines = np.cumsum(steps, axis=1)
    shifted = loop - loop.min(axis=0)
    return np.stack([lines[0, shifted[:, 0]], lines[1, shifted[:, 1]]], axis=1)


Segments = NDArray[np.float64]
"""Straight pieces, one in a row: x and y of the start, x and y of the end; shape (m, 4)."""


def wall_segments(walls: Iterable[Wall]) -> Segments:
    """The feet of walls, m, shape (m, 4)."""
    return np.array([(*wall.start, *wall.end) for wall in walls], dtype=np.float64).reshape(-1, 4)


def distances_to_segments(points: NDArray[np.float64], pieces: Segments) -> NDArray[np.float64]:
    """Distance of points, shape (n, 2), from each straight piece, m, shape (n, m)."""
    x, y = points[:, 0:1] - pieces[:, 0], points[:, 1:2] - pieces[:, 1]
    dx, dy = pieces[:, 2] - pieces[:, 0], pieces[:, 3] - pieces[:, 1]
    share = np.clip((x * dx + y * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    x -= share * dx
    y -= share * dy
    return np.sqrt(x * x + y * y)  # Half the time of np.hypot, whose care is for huge numbers.


def any_crossing(pieces: Segments) -> bool:
    """Whether any straight piece goes through another; a common end does not count."""
    start, along = pieces[:, :2], pieces[:, 2:] - pieces[:, :2]

    def side(points: NDArray[np.float64]) -> NDArray[np.float64]:
        """At which hand of each piece (rows) each point (columns) is: left is positive."""
        x, y = points[:, 0] - start[:, :1], points[:, 1] - start[:, 1:]
        hand = along[:, :1] * y - along[:, 1:] * x
        return np.where(np.abs(hand) < 1e-9, 0.0, hand)

    parted = side(pieces[:, :2]) * side(pieces[:, 2:]) < 0.0
    return bool((parted & parted.T).any())


def box_sides(obstacle: Obstacle) -> Segments:
    """The four sides of a box, counter-clockwise, m, shape (4, 4)."""
    ends = _to_world(obstacle, np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2.0)
    return np.concatenate([ends, np.roll(ends, -1, axis=0)], axis=1)


def distances_from_obstacle(obstacle: Obstacle, pieces: Segments) -> NDArray[np.float64]:
    """Distance of a thing from each straight piece, m, shape (m,); 0 or less where they overlap."""
    if obstacle.is_round:
        return (
            distances_to_segments(np.array([[obstacle.x, obstacle.y]]), pieces)[0]
            - obstacle.length / 2.0
        )
    starts, ends = _into(obstacle, pieces[:, :2]), _into(obstacle, pieces[:, 2:])
    half = np.array([obstacle.length, obstacle.width]) / 2.0
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    far = distances_to_segments(corners, np.concatenate([starts, ends], axis=1)).min(axis=0)
    far = np.minimum(far, np.minimum(_from_box(starts, half), _from_box(ends, half)))
    return np.where(_crosses(starts, ends, half), 0.0, far)


def obstacle_gap(one: Obstacle, other: Obstacle) -> float:
    """Distance of two things from each other, m; 0 or less where they overlap."""
    if other.is_round:
        return _from_point(one, other.x, other.y) - other.length / 2.0
    if one.is_round:
        return _from_point(other, one.x, one.y) - one.length / 2.0
    return float(
        min(
            distances_from_obstacle(one, box_sides(other)).min(),
            distances_from_obstacle(other, box_sides(one)).min(),
        )
    )


def _from_point(obstacle: Obstacle, x: float, y: float) -> float:
    if obstacle.is_round:
        return float(np.hypot(obstacle.x - x, obstacle.y - y)) - obstacle.length / 2.0
    half = np.array([obstacle.length, obstacle.width]) / 2.0
    return float(_from_box(_into(obstacle, np.array([[x, y]])), half)[0])


def _from_box(points: NDArray[np.float64], half: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of points from a box round the origin; 0 inside."""
    over = np.maximum(np.abs(points) - half, 0.0)
    return np.hypot(over[:, 0], over[:, 1])


def _crosses(
    starts: NDArray[np.float64], ends: NDArray[np.float64], half: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which pieces go through the inside of a box round the origin: its sides clip each."""
    ahead = ends - starts
    ahead = np.where(np.abs(ahead) < 1e-12, 1e-12, ahead)
    low, high = (-half - starts) / ahead, (half - starts) / ahead
    enter = np.minimum(low, high).max(axis=1)
    leave = np.maximum(low, high).min(axis=1)
    return np.maximum(enter, 0.0) < np.minimum(leave, 1.0)


def _axes(obstacle: Obstacle) -> NDArray[np.float64]:
    """The directions of its length and of its width, one in a row."""
    c, s = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
    return np.array([[c, s], [-s, c]])


def _into(obstacle: Obstacle, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points as seen from the middle of a thing, along its length and its width."""
    return (points - np.array([obstacle.x, obstacle.y])) @ _axes(obstacle).T


def _to_world(obstacle: Obstacle, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points given as shares of its length and width, in the world."""
    return shares * np.array([obstacle.length, obstacle.width]) @ _axes(obstacle) + [
        obstacle.x,
        obstacle.y,
    ]
