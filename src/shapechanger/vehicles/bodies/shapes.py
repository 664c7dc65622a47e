"""Solids of flat faces: arrays of corners, (n, 4, 3), counter-clockwise seen from outside, m."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Faces = NDArray[np.float64]
"""Corners of faces, (n, 4, 3), m; a triangle has its last corner twice."""


def loft(rings: ArrayLike, *, closed: bool = True) -> Faces:
    """Skin of a solid through cross-sections.

    Args:
        rings: Cross-sections from rear to front, (n, k, 3), each convex and counter-clockwise seen
            from the front.
        closed: Whether to close both ends.
    """
    points = np.asarray(rings, float)
    after = np.roll(points, -1, axis=1)
    sides = np.stack([points[:-1], after[:-1], after[1:], points[1:]], axis=2).reshape(-1, 4, 3)
    if not closed:
        return sides
    return np.concatenate([sides, fan(points[-1]), fan(points[0, ::-1])])


def fan(ring: NDArray[np.float64]) -> Faces:
    """Triangles that fill a convex ring, (k, 3), counter-clockwise seen from outside, m."""
    first = np.broadcast_to(ring[0], (len(ring) - 2, 3))
    return np.stack([first, ring[1:-1], ring[2:], ring[2:]], axis=1)


def block(low: ArrayLike, high: ArrayLike) -> Faces:
    """Box between two corners, m."""
    (x0, y0, z0), (x1, y1, z1) = np.asarray(low, float), np.asarray(high, float)
    ring = [(y0, z0), (y1, z0), (y1, z1), (y0, z1)]
    return loft([[(x, y, z) for y, z in ring] for x in (x0, x1)])


def rod(start: ArrayLike, end: ArrayLike, radius: float, sides: int = 10) -> Faces:
    """Cylinder between the middles of its ends, m.

    Args:
        start: Middle of one end.
        end: Middle of the other.
        radius: Radius, m.
        sides: Number of flat sides.
    """
    first, last = np.asarray(start, float), np.asarray(end, float)
    ahead = (last - first) / np.linalg.norm(last - first)
    up = np.array([1.0, 0.0, 0.0]) if abs(ahead[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    left = np.cross(up, ahead)
    left /= np.linalg.norm(left)
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)[:, None]
    ring = radius * (np.cos(angle) * left + np.sin(angle) * np.cross(ahead, left))
    return loft(np.stack([first + ring, last + ring]))


def section(x: float, outline: ArrayLike) -> NDArray[np.float64]:
    """Cross-section that is equal on both sides, for `loft`, (2 k, 3).

    Args:
        x: Its position ahead, m.
        outline: y, >= 0, and z from the lowest to the highest point of its left half, m, (k, 2).
    """
    left = np.asarray(outline, float)
    right = left[::-1] * (-1.0, 1.0)
    around = np.concatenate([left, right])
    return np.concatenate([np.full((len(around), 1), x), around], axis=1)


def hull(
    length: float, width: float, depth: float, *, sheer: float = 0.25, low: float = 0.0
) -> Faces:
    """Boat's hull with a pointed bow and a transom, its middle at the origin of the waterline.

    Args:
        length: Length, m.
        width: Width, m.
        depth: Height of the deck above the water amidships, m.
        sheer: Rise of the deck at the bow over the depth.
        low: Share of the depth below which it is left out.
    """
    # Position from the middle over the length, and half width of the deck and of the waterline
    # over the width: a fair line, which is full aft.
    stations = (
        (-0.5, 0.42, 0.37),
        (-0.25, 0.5, 0.45),
        (0.1, 0.5, 0.44),
        (0.3, 0.38, 0.29),
        (0.43, 0.19, 0.1),
        (0.5, 0.01, 0.005),
    )
    rings: list[NDArray[np.float64]] = []
    for x, deck, water in stations:
        top = depth * (1.0 + sheer * max(0.0, x + 0.1) / 0.6)
        start = water + low * (deck - water)
        ring = section(x * length, [(start * width, low * top), (deck * width, top)])
        ring[[0, -1], 0] -= 0.06 * length * max(0.0, x) * (1.0 - low)  # The stem leans forward.
        rings.append(ring)
    return loft(rings)


def extrude(outline: ArrayLike, right: float, left: float) -> Faces:
    """Solid with an outline in the x-z plane.

    Args:
        outline: x and z, m, (k, 2), convex and counter-clockwise seen from the right.
        right: y of its right side, m.
        left: y of its left side, m.
    """
    x, z = np.asarray(outline, float).T
    return loft([np.stack([x, np.full(len(x), y), z], axis=1) for y in (left, right)])


def moved(faces: Faces, by: ArrayLike, yaw: float = 0.0) -> Faces:
    """Faces turned about the vertical axis, rad, and then moved, m."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return faces @ turn + np.asarray(by, float)


def normals(faces: Faces) -> NDArray[np.float64]:
    """Unit vectors outwards, (n, 3)."""
    across = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    return across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)


def shading(faces: Faces) -> NDArray[np.float64]:
    """Brightness of each face under an open sky, 0 to 1, (n,): the top is brightest."""
    x, y, up = normals(faces).T
    light = 0.72 + np.where(up > 0.0, 0.28, 0.4) * up
    return np.clip(light + (0.07 * x + 0.1 * y) * (1.0 - np.abs(up)), 0.05, 1.0)
