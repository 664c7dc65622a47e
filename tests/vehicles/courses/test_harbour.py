"""Quays, moored boats and the far shore."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.vehicles.courses import lay_out
from shapechanger.vehicles.courses.course import Course, Look
from shapechanger.vehicles.courses.geometry import distances_to_segments, wall_segments
from shapechanger.vehicles.courses.surfaces import (
    BANK_M,
    QuadMesh,
    Surfaces,
    fittings,
    moored,
)

_SEEDS = (0, 1, 2, 5, 1_000_000)
# Tyres and ladders stand out of their wall.
_PROUD_M = 0.021


def _in_lane(course: Course, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points, m, (n, 2), are within the lane, by the number of walls that a ray meets.

    The lane is between two closed lines, and everything else is inside the inner or outside both.
    """
    starts = np.array([wall.start for wall in course.walls])
    ends = np.array([wall.end for wall in course.walls])
    x, y = points[:, None, 0], points[:, None, 1]
    (x0, y0), (x1, y1) = starts.T, ends.T
    spans = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    return (spans & (at > x)).sum(axis=1) % 2 == 1


def _from_walls(course: Course, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of points, m, (n, 2), from the nearest wall, m, (n,)."""
    return distances_to_segments(points, wall_segments(course.walls)).min(axis=1)


def _points(mesh: QuadMesh) -> NDArray[np.float64]:
    return mesh.arrays(mirrored=False)[0]


@pytest.mark.parametrize("seed", _SEEDS)
def test_the_lane_stays_free(seed: int) -> None:
    """Fittings, moored boats and tops of quays are behind the walls, but for tyres and ladders."""
    course = lay_out("harbour", seed)
    banks = Surfaces(course, Look.of("harbour")).walls()
    flat = np.concatenate([_points(p) for p in (*banks.values(), fittings(course))])[:, :2]
    assert _in_lane(course, course.route).all()  # The check itself works.
    wrong = _in_lane(course, flat) & (_from_walls(course, flat) > _PROUD_M)
    assert not wrong.any()


@pytest.mark.parametrize("seed", _SEEDS)
def test_boats_lie_behind_quays(seed: int) -> None:
    """Several boats lie at a quay, and none overlaps with a quay or another boat."""
    course = lay_out("harbour", seed)
    boats = moored(course)
    assert len(boats) >= 3
    uvs = np.array([(boat.x, boat.y) for boat in boats])
    near = _from_walls(course, uvs)
    assert not _in_lane(course, uvs).any()
    for boat, metres in zip(boats, near, strict=True):
        assert BANK_M < metres < BANK_M + 0.34 * boat.length
    gaps = np.linalg.norm(uvs[:, None] - uvs, axis=2) + 9.0 * np.eye(len(boats))
    assert gaps.min() > 1.5


@pytest.mark.parametrize("seed", _SEEDS)
def test_obstacles_are_drawn_where_the_course_says(seed: int) -> None:
    """Each is drawn within its collision geom, and fills it at the height of a boat's hull."""
    course = lay_out("harbour", seed)
    for obstacle in course.obstacles:
        alone = replace(course, obstacles=(obstacle,))
        points = _points(Surfaces(alone, Look.of("harbour")).obstacles())
        cosine, sine = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
        flat = (points[:, :2] - (obstacle.x, obstacle.y)) @ np.array(
            [[cosine, -sine], [sine, cosine]]
        )
        half = 0.5 * np.array([obstacle.length, obstacle.width])
        assert points[:, 2].min() >= 0.0
        assert points[:, 2].max() == pytest.approx(obstacle.height, rel=0.01)
        if obstacle.is_round:
            assert np.linalg.norm(flat, axis=1).max() == pytest.approx(half[0], rel=0.01)
        else:
            np.testing.assert_allclose(np.abs(flat).max(axis=0), half, rtol=0.01)
