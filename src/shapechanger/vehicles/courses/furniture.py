"""Random placement of obstacles and patches of sun, which keeps the lane passable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from shapechanger.vehicles.courses.course import Lamp, Obstacle, ObstacleKind, Wall
from shapechanger.vehicles.courses.geometry import (
    Array,
    arc_lengths,
    distances_from_obstacle,
    distances_to_segments,
    length,
    normals,
    obstacle_gap,
    wall_segments,
)


def weighted_choice(rng: np.random.Generator, shares: Sequence[float]) -> int:
    """Draw an index with a probability proportional to its share, >= 0.

    `Generator.choice` would be thirty times slower, and each panel of a wall needs a draw.
    """
    left = float(rng.random()) * sum(shares)
    for i, share in enumerate(shares):
        left -= share
        if left < 0.0:
            return i
    return len(shares) - 1


# Lengths of the route without obstacles after and before its first point, m; a truck has 0.84 m.
_FREE_AHEAD_M, _FREE_BEHIND_M = 3.0, 2.0
_BEFORE_DOORS_M: Final = 0.3  # Smallest distance from a door.


@dataclass(frozen=True, slots=True)
class Scatter:
    """A kind of obstacle; `open_worlds.toml` describes the fields."""

    kind: ObstacleKind
    length: tuple[float, float]
    width: tuple[float, float]
    height: tuple[float, float]
    share: float
    moored: float = 0.0

    def draw(self, rng: np.random.Generator, yaw: float) -> Obstacle:
        """Draw an obstacle at the origin; for a round one, the yaw is 0 and width equals length."""
        bounds = (self.length, self.width, self.height)
        length, width, height = (float(rng.uniform(*each)) for each in bounds)
        obstacle = Obstacle(self.kind, 0.0, 0.0, yaw, length, width, height)
        return replace(obstacle, yaw=0.0, width=length) if obstacle.is_round else obstacle


class LaneObstacles:
    """Obstacles in a lane; one that would block the lane, a door or the start is rejected.

    Vehicles pass an obstacle on its wider side, which is at least the argument `gap_m` wide. Two
    that are passed on the same side may be close together; others are `gap_m` + 0.1 m apart.
    `route` and `half_width` are as in `Course`.
    """

    def __init__(
        self, route: Array, left: tuple[Wall, ...], right: tuple[Wall, ...], gap_m: float
    ) -> None:
        self.route, self._lefts, self._wanted = route, len(left), gap_m
        self._walls = wall_segments((*left, *right))
        self._doors = np.array([wall.surface == "door" for wall in (*left, *right)])
        self.half_width = distances_to_segments(route, self._walls).min(axis=1)
        self.gap_m = 2.0 * float(self.half_width.min())  # Narrowest remaining passage.
        self._round_m = length(route)
        self.obstacles: list[Obstacle] = []
        self._passed_left: list[bool] = []

    def offer(self, obstacle: Obstacle, s: float) -> None:
        """Add an obstacle `s` m along the route if it fits."""
        reach = max(obstacle.length, obstacle.width) / 2.0
        s %= self._round_m
        if s - reach < _FREE_AHEAD_M or self._round_m - s - reach < _FREE_BEHIND_M:
            return
        far = distances_from_obstacle(obstacle, self._walls)
        left, right = float(far[: self._lefts].min()), float(far[self._lefts :].min())
        narrowest, passed_left = max(left, right), left >= right
        if min(left, right) <= 0.0 or narrowest < self._wanted:
            return
        if (far[self._doors] < _BEFORE_DOORS_M).any():
            return
        for other, other_left in zip(self.obstacles, self._passed_left, strict=True):
            apart, across = obstacle_gap(obstacle, other), passed_left != other_left
            if apart <= 0.0 or (across and apart < self._wanted + 0.1):
                return
            if across:
                narrowest = min(narrowest, apart)
        self.gap_m = min(self.gap_m, narrowest)
        self.obstacles.append(obstacle)
        self._passed_left.append(passed_left)


def scatter_obstacles(
    rng: np.random.Generator, obstacles: LaneObstacles, kinds: tuple[Scatter, ...], per_m: float
) -> None:
    """Offer random obstacles to a lane, on average `per_m` for each metre."""
    route, half_width = obstacles.route, obstacles.half_width
    along, left = arc_lengths(route), normals(route)
    shares = [kind.share for kind in kinds]
    for _ in range(rng.poisson(per_m * float(along[-1]))):
        kind = kinds[weighted_choice(rng, shares)]
        i = int(rng.integers(len(route)))
        heading = float(np.arctan2(-left[i, 0], left[i, 1]))
        obstacle = kind.draw(rng, heading)
        most = float(half_width[i]) - obstacle.width / 2.0
        if rng.random() < kind.moored:
            side = 1.0 if rng.random() < 0.5 else -1.0
            aside = side * (most - float(rng.uniform(0.05, 0.3)))
        else:
            aside = float(rng.uniform(-most, most))
            if not obstacle.is_round:
                obstacle = replace(obstacle, yaw=float(rng.uniform(-np.pi, np.pi)))
        x, y = route[i] + left[i] * aside
        obstacles.offer(replace(obstacle, x=float(x), y=float(y)), float(along[i]))


def place_sun_patches(
    rng: np.random.Generator, route: Array, half_width: Array
) -> tuple[Lamp, ...]:
    """Two to eight patches of sun on a route, m, (n, 2), with a half width, m, (n,)."""
    left = normals(route)
    lamps: list[Lamp] = []
    for _ in range(int(rng.integers(2, 9))):
        i = int(rng.integers(len(route)))
        x, y = route[i] + left[i] * half_width[i] * float(rng.uniform(-0.6, 0.6))
        long, wide = float(rng.uniform(0.8, 2.0)), float(rng.uniform(0.4, 1.0))
        lamps.append(Lamp(float(x), float(y), float(rng.uniform(-np.pi, np.pi)), long, wide))
    return tuple(lamps)
