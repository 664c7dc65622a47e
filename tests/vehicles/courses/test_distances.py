"""Distances between obstacles and walls, compared with sampled points."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.vehicles.courses.course import Obstacle
from shapechanger.vehicles.courses.geometry import (
    any_crossing,
    box_sides,
    distances_from_obstacle,
    obstacle_gap,
)


def _random_thing(rng: np.random.Generator) -> Obstacle:
    x, y, yaw = rng.uniform(-2.0, 2.0, 3)
    length, width = rng.uniform(0.2, 1.5, 2)
    if rng.random() < 0.4:
        return Obstacle("bin", x, y, 0.0, length, length, 1.0)
    return Obstacle("box", x, y, yaw, length, width, 1.0)


def _samples(obstacle: Obstacle) -> np.ndarray:
    """Return sampled points of an obstacle."""
    a = np.linspace(-0.5, 0.5, 41)
    shares = np.stack(np.meshgrid(a, a), axis=-1).reshape(-1, 2)
    if obstacle.is_round:
        shares = np.concatenate(
            [np.outer(r, [np.cos(t), np.sin(t)]) for t in np.linspace(0, 6.3, 150) for r in [a]]
        )
    cos, sin = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
    along = shares * [obstacle.length, obstacle.width]
    return along @ np.array([[cos, sin], [-sin, cos]]) + [obstacle.x, obstacle.y]


def _nearest(one: np.ndarray, other: np.ndarray) -> float:
    return float(
        min(np.hypot(*(other - point).T).min() for point in one[:: max(1, len(one) // 300)])
    )


@pytest.mark.parametrize("seed", range(25))
def test_distances_are_those_of_the_nearest_points(seed: int) -> None:
    """Distances equal those of the nearest samples, and are 0 or less on overlap."""
    rng = np.random.default_rng(seed)
    one, other = _random_thing(rng), _random_thing(rng)
    measured = _nearest(_samples(one), _samples(other))
    assert max(obstacle_gap(one, other), 0.0) == pytest.approx(measured, abs=0.1)
    assert obstacle_gap(one, other) == pytest.approx(obstacle_gap(other, one))
    piece = rng.uniform(-2.0, 2.0, (1, 4))
    line = piece[0, :2] + np.linspace(0, 1, 200)[:, None] * (piece[0, 2:] - piece[0, :2])
    far = float(distances_from_obstacle(one, piece)[0])
    assert max(far, 0.0) == pytest.approx(_nearest(_samples(one), line), abs=0.1)


def test_a_contained_obstacle_overlaps() -> None:
    """A box inside another overlaps it, although no sides cross."""
    large = Obstacle("box", 0.0, 0.0, 0.3, 2.0, 2.0, 1.0)
    small = Obstacle("box", 0.1, 0.0, 1.0, 0.2, 0.3, 1.0)
    assert obstacle_gap(large, small) == 0.0
    assert obstacle_gap(small, large) == 0.0
    assert distances_from_obstacle(large, box_sides(small)) == pytest.approx(0.0)


def test_shared_ends_are_not_crossings() -> None:
    """Segments that share an end do not cross."""
    chain = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    tie = chain[[0, 2, 1, 3]]
    assert not any_crossing(np.hstack([chain, np.roll(chain, -1, 0)]))
    assert any_crossing(np.hstack([tie, np.roll(tie, -1, 0)]))
