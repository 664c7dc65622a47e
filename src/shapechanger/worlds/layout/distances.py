"""How far things, walls and points are from each other, seen from above."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Thing, Wall

__all__ = ["between", "cross_each_other", "from_thing", "outline", "segments", "to_segments"]

Segments = NDArray[np.float64]
"""Straight pieces, one in a row: x and y of the start, x and y of the end; shape (m, 4)."""


def segments(walls: Iterable[Wall]) -> Segments:
    """The feet of walls, m, shape (m, 4)."""
    return np.array([(*wall.start, *wall.end) for wall in walls], dtype=np.float64).reshape(-1, 4)


def to_segments(points: NDArray[np.float64], pieces: Segments) -> NDArray[np.float64]:
    """Distance of points, shape (n, 2), from each straight piece, m, shape (n, m)."""
    x, y = points[:, 0:1] - pieces[:, 0], points[:, 1:2] - pieces[:, 1]
    dx, dy = pieces[:, 2] - pieces[:, 0], pieces[:, 3] - pieces[:, 1]
    share = np.clip((x * dx + y * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    x -= share * dx
    y -= share * dy
    return np.sqrt(x * x + y * y)  # Half the time of np.hypot, whose care is for huge numbers.


def cross_each_other(pieces: Segments) -> bool:
    """Whether any straight piece goes through another; a common end does not count."""
    start, along = pieces[:, :2], pieces[:, 2:] - pieces[:, :2]

    def side(points: NDArray[np.float64]) -> NDArray[np.float64]:
        """At which hand of each piece (rows) each point (columns) is: left is positive."""
        x, y = points[:, 0] - start[:, :1], points[:, 1] - start[:, 1:]
        hand = along[:, :1] * y - along[:, 1:] * x
        return np.where(np.abs(hand) < 1e-9, 0.0, hand)

    parted = side(pieces[:, :2]) * side(pieces[:, 2:]) < 0.0
    return bool((parted & parted.T).any())


def outline(thing: Thing) -> Segments:
    """The four sides of a box, counter-clockwise, m, shape (4, 4)."""
    ends = _to_world(thing, np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2.0)
    return np.concatenate([ends, np.roll(ends, -1, axis=0)], axis=1)


def from_thing(thing: Thing, pieces: Segments) -> NDArray[np.float64]:
    """Distance of a thing from each straight piece, m, shape (m,); 0 or less where they overlap."""
    if thing.is_round:
        return to_segments(np.array([[thing.x, thing.y]]), pieces)[0] - thing.length / 2.0
    starts, ends = _into(thing, pieces[:, :2]), _into(thing, pieces[:, 2:])
    half = np.array([thing.length, thing.width]) / 2.0
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    far = to_segments(corners, np.concatenate([starts, ends], axis=1)).min(axis=0)
    far = np.minimum(far, np.minimum(_from_box(starts, half), _from_box(ends, half)))
    return np.where(_crosses(starts, ends, half), 0.0, far)


def between(one: Thing, other: Thing) -> float:
    """Distance of two things from each other, m; 0 or less where they overlap."""
    if other.is_round:
        return _from_point(one, other.x, other.y) - other.length / 2.0
    if one.is_round:
        return _from_point(other, one.x, one.y) - one.length / 2.0
    return float(min(from_thing(one, outline(other)).min(), from_thing(other, outline(one)).min()))


def _from_point(thing: Thing, x: float, y: float) -> float:
    if thing.is_round:
        return float(np.hypot(thing.x - x, thing.y - y)) - thing.length / 2.0
    half = np.array([thing.length, thing.width]) / 2.0
    return float(_from_box(_into(thing, np.array([[x, y]])), half)[0])


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


def _axes(thing: Thing) -> NDArray[np.float64]:
    """The directions of its length and of its width, one in a row."""
    c, s = np.cos(thing.yaw), np.sin(thing.yaw)
    return np.array([[c, s], [-s, c]])


def _into(thing: Thing, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points as seen from the middle of a thing, along its length and its width."""
    return (points - np.array([thing.x, thing.y])) @ _axes(thing).T


def _to_world(thing: Thing, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points given as shares of its length and width, in the world."""
    return shares * np.array([thing.length, thing.width]) @ _axes(thing) + [thing.x, thing.y]
