"""Courses as grids of cells."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.vehicles.courses import WORLDS, lay_out
from shapechanger.vehicles.courses.course import Course, Obstacle, Surface, Wall
from shapechanger.vehicles.courses.geometry import distances_to_segments, wall_segments
from tests.vehicles.courses.raster import occupancy


def _ring(*obstacles: Obstacle) -> Course:
    """Return a square lane, 2 m wide, around a block of 2 m by 2 m."""

    def walls(corners: list[tuple[float, float]]) -> list[Wall]:
        surface: Surface = "plaster"
        pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
        return [Wall(a, b, 1.0, surface) for a, b in pairs]

    outer = walls([(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)])
    inner = walls([(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)])
    route = np.array([(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)])
    return Course(
        "corridor", 0, route, np.ones(4), (*outer, *inner), obstacles, (), 2.5, 1.0
    )  # fmt: skip


def test_the_lane_is_free_and_the_rest_blocked() -> None:
    blocked, (x0, y0) = occupancy(_ring(), 0.1)
    rows, columns = np.nonzero(~blocked)
    assert len(rows) * 0.01 == pytest.approx(36.0 - 4.0, rel=0.04)
    x, y = x0 + 0.1 * columns, y0 + 0.1 * rows
    reach = np.maximum(np.abs(x), np.abs(y))
    assert reach.min() >= 1.0 - 1e-9
    assert reach.max() <= 3.0 + 1e-9
    rim = [*blocked[0], *blocked[-1], *blocked[:, 0], *blocked[:, -1]]
    assert all(rim)


@pytest.mark.parametrize(
    ("obstacle", "area"),
    [
        (Obstacle("box", 2.0, 0.3, 0.7, 0.8, 0.4, 0.5), 0.32),
        (Obstacle("bin", -2.0, 0.3, 0.0, 0.6, 0.6, 0.5), np.pi * 0.09),
    ],
)
def test_obstacles_are_blocked(obstacle: Obstacle, area: float) -> None:
    empty, (x0, y0) = occupancy(_ring(), 0.02)
    full, _ = occupancy(_ring(obstacle), 0.02)
    rows, columns = np.nonzero(full & ~empty)
    assert len(rows) * 0.02**2 == pytest.approx(area, rel=0.05)
    assert x0 + 0.02 * columns.mean() == pytest.approx(obstacle.x, abs=0.01)
    assert y0 + 0.02 * rows.mean() == pytest.approx(obstacle.y, abs=0.01)
    assert not (empty & ~full).any()


@pytest.mark.parametrize("world", WORLDS)
def test_the_route_is_free_of_walls(world: str) -> None:
    """Cells near the route are free, cells behind walls are blocked."""
    course = lay_out(world, 5)
    blocked, (x0, y0) = occupancy(course, 0.05)
    rows, columns = np.nonzero(~blocked)
    middles = np.array([x0 + 0.05 * columns, y0 + 0.05 * rows], np.float64).T
    near = distances_to_segments(
        middles[::50], np.hstack([course.route, np.roll(course.route, -1, 0)])
    )
    # The farthest free cell is in an outer corner of a corridor or between rocks.
    assert near.min(axis=1).max() <= 1.5 * course.half_width.max()
    walls = wall_segments(course.walls)
    middle_of_walls = (walls[:, :2] + walls[:, 2:]) / 2.0
    back = walls[:, 2:] - walls[:, :2]
    behind = middle_of_walls + 0.1 * np.stack([back[:, 1], -back[:, 0]], axis=1) / np.hypot(
        back[:, :1], back[:, 1:]
    )
    r = np.rint((behind[:, 1] - y0) / 0.05).astype(int)
    c = np.rint((behind[:, 0] - x0) / 0.05).astype(int)
    inside = (r >= 0) & (c >= 0) & (r < blocked.shape[0]) & (c < blocked.shape[1])
    assert blocked[r[inside], c[inside]].mean() > 0.97  # Door jambs have the lane behind them.
