"""How far points are from whatever stands in a course."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course

__all__ = ["FAR_M", "Obstacles"]

FAR_M: Final = 2.5
"""Distances are exact up to here and given as this beyond: nobody drives by what is farther."""

_CHUNK: Final = 256


class Obstacles:
    """The walls and things of a course, seen from above.

    Args:
        course: What they stand in.
    """

    def __init__(self, course: Course) -> None:
        walls = np.array([(*w.start, *w.end) for w in course.walls], np.float64).reshape(-1, 4)
        self._start, self._step = walls[:, :2], walls[:, 2:] - walls[:, :2]
        self._squared = np.maximum(np.einsum("ij,ij->i", self._step, self._step), 1e-12)
        boxes = [t for t in course.things if not t.is_round]
        rounds = [t for t in course.things if t.is_round]
        self._box = np.array(
            [(t.x, t.y, np.cos(t.yaw), np.sin(t.yaw), t.length / 2, t.width / 2) for t in boxes],
            np.float64,
        ).reshape(-1, 6)
        self._round = np.array([(t.x, t.y, t.length / 2) for t in rounds], np.float64)
        self._round = self._round.reshape(-1, 3)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of each point from the nearest wall or thing, m, at most `FAR_M`; 0 inside.

        It is fast where neighbours in the array are neighbours in the course.

        Args:
            points: (N, 2), m.

        Returns:
            (N,).
        """
        parts = [self._near(points[i : i + _CHUNK]) for i in range(0, max(len(points), 1), _CHUNK)]
        return np.concatenate(parts)

    def _near(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """As `distance`, for points that lie close together."""
        found = np.full(len(points), FAR_M)
        if not len(points):
            return found
        low, high = points.min(axis=0) - FAR_M, points.max(axis=0) + FAR_M
        found = np.minimum(found, self._from_walls(points, low, high))
        found = np.minimum(found, self._from_boxes(points, low, high))
        return np.minimum(found, self._from_rounds(points, low, high))

    def _from_walls(
        self, points: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distance of each point from the nearest wall that reaches into a rectangle."""
        end = self._start + self._step
        near = (np.maximum(self._start, end) >= low) & (np.minimum(self._start, end) <= high)
        near = near.all(axis=1)
        step = self._step[near][:, None]
        away = points - self._start[near][:, None]  # (walls, points, 2)
        share = np.einsum("wpj,wpj->wp", away, np.broadcast_to(step, away.shape))
        share = np.clip(share / self._squared[near][:, None], 0.0, 1.0)
        away -= share[:, :, None] * step
        squared = np.einsum("wpj,wpj->wp", away, away)
        return np.sqrt(squared.min(axis=0, initial=FAR_M**2))

    def _from_boxes(
        self, points: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """As `_from_walls`, of boxes."""
        reach = (self._box[:, 4] + self._box[:, 5])[:, None]
        near = (self._box[:, :2] + reach >= low) & (self._box[:, :2] - reach <= high)
        x, y, cos, sin, half_length, half_width = self._box[near.all(axis=1)].T[:, :, None]
        dx, dy = points[:, 0] - x, points[:, 1] - y
        along = np.maximum(np.abs(cos * dx + sin * dy) - half_length, 0.0)
        across = np.maximum(np.abs(cos * dy - sin * dx) - half_width, 0.0)
        return np.hypot(along, across).min(axis=0, initial=FAR_M)

    def _from_rounds(
        self, points: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """As `_from_walls`, of cylinders."""
        reach = self._round[:, 2:]
        near = (self._round[:, :2] + reach >= low) & (self._round[:, :2] - reach <= high)
        x, y, radius = self._round[near.all(axis=1)].T[:, :, None]
        off = np.hypot(points[:, 0] - x, points[:, 1] - y) - radius
        return np.maximum(off, 0.0).min(axis=0, initial=FAR_M)
