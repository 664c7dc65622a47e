"""Occupancy grids of courses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.course import Course, Obstacle
from shapechanger.vehicles.courses.geometry import wall_segments


def occupancy(course: Course, cell_m: float) -> tuple[NDArray[np.bool_], tuple[float, float]]:
    """Return a grid of cells, and x and y of the centre of cell [0, 0], m.

    Cells are True if their centre is outside the lane or in an obstacle; rows go along y and
    columns along x.
    """
    feet = wall_segments(course.walls)
    low = np.minimum(feet[:, :2], feet[:, 2:]).min(axis=0) - 1.5 * cell_m
    high = np.maximum(feet[:, :2], feet[:, 2:]).max(axis=0) + 1.5 * cell_m
    columns, rows = (int(n) + 1 for n in np.ceil((high - low) / cell_m))
    x0, y0 = float(low[0]), float(low[1])
    y = y0 + cell_m * np.arange(rows)
    # Along a row, cells after an odd number of walls are inside.
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
