"""Distances of things and walls, against many points of them."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.worlds.course import Thing
from shapechanger.worlds.layout.geometry import between, box_sides, cross_each_other, from_thing


def _random_thing(rng: np.random.Generator) -> Thing:
    x, y, yaw = rng.uniform(-2.0, 2.0, 3)
    length, width = rng.uniform(0.2, 1.5, 2)
    if rng.random() < 0.4:
        return Thing("bin", x, y, 0.0, length, length, 1.0)
    return Thing("box", x, y, yaw, length, width, 1.0)


def _samples(thing: Thing) -> np.ndarray:
    """Points all over a thing."""
    a = np.linspace(-0.5, 0.5, 41)
    shares = np.stack(np.meshgrid(a, a), axis=-1).reshape(-1, 2)
    if thing.is_round:
        shares = np.concatenate(
            [np.outer(r, [np.cos(t), np.sin(t)]) for t in np.linspace(0, 6.3, 150) for r in [a]]
        )
    cos, sin = np.cos(thing.yaw), np.sin(thing.yaw)
    along = shares * [thing.length, thing.width]
    return along @ np.array([[cos, sin], [-sin, cos]]) + [thing.x, thing.y]


def _nearest(one: np.ndarray, other: np.ndarray) -> float:
    return float(
        min(np.hypot(*(other - point).T).min() for point in one[:: max(1, len(one) // 300)])
    )


@pytest.mark.parametrize("seed", range(25))
def test_distances_are_those_of_the_nearest_points(seed: int) -> None:
    """Things and walls are as far apart as their nearest points, and 0 or less where they meet."""
    rng = np.random.default_rng(seed)
    one, other = _random_thing(rng), _random_thing(rng)
    measured = _nearest(_samples(one), _samples(other))
    assert max(between(one, other), 0.0) == pytest.approx(measured, abs=0.1)
    assert between(one, other) == pytest.approx(between(other, one))
    piece = rng.uniform(-2.0, 2.0, (1, 4))
    line = piece[0, :2] + np.linspace(0, 1, 200)[:, None] * (piece[0, 2:] - piece[0, :2])
    far = float(from_thing(one, piece)[0])
    assert max(far, 0.0) == pytest.approx(_nearest(_samples(one), line), abs=0.1)


def test_a_thing_inside_another_is_no_distance_away() -> None:
    """A small box within a large one overlaps it, although no side of theirs crosses."""
    large = Thing("box", 0.0, 0.0, 0.3, 2.0, 2.0, 1.0)
    small = Thing("box", 0.1, 0.0, 1.0, 0.2, 0.3, 1.0)
    assert between(large, small) == 0.0
    assert between(small, large) == 0.0
    assert from_thing(large, box_sides(small)) == pytest.approx(0.0)


def test_pieces_cross_only_in_their_middles() -> None:
    """A chain whose pieces share ends does not cross itself; a bow tie does."""
    chain = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    tie = chain[[0, 2, 1, 3]]
    assert not cross_each_other(np.hstack([chain, np.roll(chain, -1, 0)]))
    assert cross_each_other(np.hstack([tie, np.roll(tie, -1, 0)]))
