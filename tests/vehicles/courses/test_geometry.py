"""Closed lines, loops on a grid, and distances, which are compared with sampled points."""

import numpy as np
import pytest

from shapechanger.vehicles.courses.course import Obstacle
from shapechanger.vehicles.courses.geometry import (
    any_crossing,
    distances_from_obstacle,
    grow_cells,
    length,
    obstacle_gap,
    resample,
    scale_grid,
    trace_outline,
)


def _ellipse(a: float, b: float, n: int) -> np.ndarray:
    angles = 2 * np.pi * np.arange(n) / n
    return np.stack([a * np.cos(angles), b * np.sin(angles)], axis=1)


def test_resampled_points_are_evenly_spaced() -> None:
    line = resample(_ellipse(6.0, 2.0, 2000), 0.1)
    chords = np.hypot(*np.diff(line, axis=0, append=line[:1]).T)
    assert chords == pytest.approx(chords[0], rel=1e-3)
    assert chords[0] == pytest.approx(0.1, rel=0.01)
    assert length(line) == pytest.approx(length(_ellipse(6.0, 2.0, 2000)), rel=1e-3)


@pytest.mark.parametrize(
    "cells",
    [
        frozenset({(0, 0), (1, 1)}),
        frozenset({(x, y) for x in range(3) for y in range(3)} - {(1, 1)}),
        frozenset({(0, 0), (5, 5)}),
    ],
    ids=["a corner touches", "a hole", "two pieces"],
)
def test_self_touching_outlines_are_refused(cells: frozenset[tuple[int, int]]) -> None:
    assert trace_outline(cells) is None


@pytest.mark.parametrize("seed", range(20))
def test_outlines_of_grown_cells_have_unit_steps_and_no_repeated_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = grow_cells(rng, 6)
    assert len(cells) == 6
    loop = trace_outline(cells)
    if loop is None:
        return
    assert (np.abs(np.diff(loop, axis=0, append=loop[:1])).sum(axis=1) == 1).all()
    assert len({tuple(point) for point in loop}) == len(loop)
    metres = scale_grid(rng, loop, 4.0, 6.0)
    apart = np.hypot(*np.diff(metres, axis=0, append=metres[:1]).T)
    assert 4.0 <= apart.min() <= apart.max() <= 6.0


def _random_obstacle(rng: np.random.Generator) -> Obstacle:
    x, y, yaw = rng.uniform(-2.0, 2.0, 3)
    long, wide = rng.uniform(0.2, 1.5, 2)
    if rng.random() < 0.4:
        return Obstacle("bin", x, y, 0.0, long, long, 1.0)
    return Obstacle("box", x, y, yaw, long, wide, 1.0)


def _samples(obstacle: Obstacle) -> np.ndarray:
    a = np.linspace(-0.5, 0.5, 41)
    shares = np.stack(np.meshgrid(a, a), axis=-1).reshape(-1, 2)
    if obstacle.is_round:
        angles = np.linspace(0, 6.3, 150)
        shares = np.concatenate([np.outer(a, [np.cos(t), np.sin(t)]) for t in angles])
    cos, sin = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
    along = shares * [obstacle.length, obstacle.width]
    return along @ np.array([[cos, sin], [-sin, cos]]) + [obstacle.x, obstacle.y]


def _nearest(one: np.ndarray, other: np.ndarray) -> float:
    some = one[:: max(1, len(one) // 300)]
    return float(min(np.hypot(*(other - point).T).min() for point in some))


@pytest.mark.parametrize("seed", range(25))
def test_distances_are_those_of_the_nearest_points(seed: int) -> None:
    """Distances equal the nearest samples', and are 0 or less on overlap."""
    rng = np.random.default_rng(seed)
    one, other = _random_obstacle(rng), _random_obstacle(rng)
    piece = rng.uniform(-2.0, 2.0, (1, 4))
    line = piece[0, :2] + np.linspace(0, 1, 200)[:, None] * (piece[0, 2:] - piece[0, :2])
    assert obstacle_gap(one, other) == pytest.approx(obstacle_gap(other, one))
    for found, points in (
        (obstacle_gap(one, other), _samples(other)),
        (float(distances_from_obstacle(one, piece)[0]), line),
    ):
        assert max(found, 0.0) == pytest.approx(_nearest(_samples(one), points), abs=0.1)


def test_segments_that_share_an_end_do_not_cross() -> None:
    chain = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    tie = chain[[0, 2, 1, 3]]
    assert not any_crossing(np.hstack([chain, np.roll(chain, -1, 0)]))
    assert any_crossing(np.hstack([tie, np.roll(tie, -1, 0)]))
