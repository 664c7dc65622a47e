"""Corridors of an office building: straight legs, right-angled corners, and panelled walls."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.course import Course, Lamp, Surface, Wall
from shapechanger.vehicles.courses.furniture import LaneObstacles, Scatter, weighted_choice
from shapechanger.vehicles.courses.geometry import (
    Array,
    arc_lengths,
    random_loop,
    resample,
    turn_angles,
)

_DOOR_M: Final = 0.9 + 2 * 0.06  # Width of a door with its frame.
_RECESS_M: Final = 0.15  # Depth of a recessed door.
_PLAIN_M: Final = (0.4, 2.4)

# Panels in the plaster: surface, share of the panels, and range of widths, m.
_PANELS: tuple[tuple[Surface, float, tuple[float, float]], ...] = (
    ("door", 0.5, (_DOOR_M, _DOOR_M)),
    ("window", 0.2, (1.0, 2.0)),
    ("board", 0.18, (1.0, 2.4)),
    ("glass", 0.12, (0.8, 1.6)),
)
_PANEL_SHARES = [share for _, share, _ in _PANELS]


def panel_walls(
    rng: np.random.Generator, corners: Array, bends: NDArray[np.int64], height: float
) -> tuple[Wall, ...]:
    """Walls along a closed line of corners, m, (n, 2), with the lane on their left.

    Legs, the lines between corners, are at least 1.5 m long and at right angles. `bends`, (n,), is
    1 for corners that project into the lane, and -1 for nooks.
    """
    n = len(corners)
    # Length by which each corner is cut off, m; mostly 0.
    cut = np.where(rng.random(n) < 0.3, rng.uniform(0.2, 0.5, n), 0.0)
    brick = np.where((bends > 0) & (rng.random(n) < 0.35), rng.uniform(0.3, 0.8, n), 0.0)
    ahead, _ = _legs(corners)
    walls: list[Wall] = []
    for k in range(n):
        after = (k + 1) % n
        start, end = corners[k] + ahead[k] * cut[k], corners[after] - ahead[k] * cut[after]
        first, last = start + ahead[k] * brick[k], end - ahead[k] * brick[after]
        if brick[k] > 0.0:
            walls.append(Wall.between(start, first, height, "brick"))
        walls.extend(_leg(rng, first, last, height))
        if brick[after] > 0.0:
            walls.append(Wall.between(last, end, height, "brick"))
        if cut[after] > 0.0:
            beyond = corners[after] + ahead[after] * cut[after]
            surface = "brick" if brick[after] > 0.0 else "plaster"
            walls.append(Wall.between(end, beyond, height, surface))
    return tuple(walls)


def _leg(rng: np.random.Generator, start: Array, end: Array, height: float) -> Iterator[Wall]:
    """Walls of plaster with panels between two points."""
    length = float(np.hypot(*(end - start)))
    ahead = (end - start) / length
    back = np.array([ahead[1], -ahead[0]]) * _RECESS_M  # Away from the lane.
    done = start
    t = float(rng.uniform(*_PLAIN_M))
    while True:
        surface, _, bounds = _PANELS[weighted_choice(rng, _PANEL_SHARES)]
        wide = float(rng.uniform(*bounds))
        recessed = surface == "door" and rng.random() < 0.4
        gap = float(rng.uniform(*_PLAIN_M))
        if t + wide + 0.3 > length:
            break
        near, far = start + ahead * t, start + ahead * (t + wide)
        yield Wall.between(done, near, height, "plaster")
        done, t = far, t + wide + gap
        if recessed:
            yield Wall.between(near, near + back, height, "plaster")
            near, done = near + back, far + back
        yield Wall.between(near, done, height, surface)
        if recessed:
            yield Wall.between(done, far, height, "plaster")
            done = far
    yield Wall.between(done, end, height, "plaster")


_CEILING_M: Final = 2.5  # Height of the ceiling, and of every wall.
_PITCH_M, _WIDTH_M, _LENGTH_M = (4.0, 6.0), (1.8, 2.4), (40.0, 90.0)
_GAP_M, _SPACING_M = 0.9, 0.1

# Furniture of common sizes along the walls; the width is the depth from the wall.
_FURNITURE = (
    Scatter("box", (0.3, 0.6), (0.25, 0.45), (0.2, 0.5), 0.2),
    Scatter("bin", (0.25, 0.35), (0.25, 0.35), (0.5, 0.7), 0.2),
    Scatter("bench", (1.2, 1.6), (0.38, 0.45), (0.42, 0.48), 0.18),
    Scatter("plant", (0.3, 0.45), (0.3, 0.45), (0.8, 1.5), 0.18),
    Scatter("cabinet", (0.8, 1.2), (0.4, 0.5), (1.0, 1.9), 0.14),
    Scatter("crate", (0.4, 0.6), (0.3, 0.4), (0.25, 0.4), 0.1),
)


def corridor(rng: np.random.Generator, seed: int) -> Course | None:
    """Try to lay out a corridor; None if the random layout does not fit."""
    corners = _corners(rng)
    if corners is None:
        return None
    widths = rng.uniform(*_WIDTH_M, size=len(corners))
    route, starts = _route(corners, widths)
    along = arc_lengths(route)
    if not _LENGTH_M[0] <= along[-1] <= _LENGTH_M[1]:
        return None
    ahead, _ = _legs(corners)
    normals = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    reach = (np.roll(normals * widths[:, None], 1, axis=0) + normals * widths[:, None]) / 2.0
    turns = _turns(corners)
    # Walls have the lane on their left: the right one runs forwards, the left one backwards.
    right = panel_walls(rng, corners - reach, -turns, _CEILING_M)
    left = panel_walls(rng, (corners + reach)[::-1], turns[::-1], _CEILING_M)
    obstacles = LaneObstacles(route, left, right, _GAP_M)
    _furnish(rng, obstacles, corners, normals, widths, starts)
    _plant(rng, obstacles, corners, reach * turns[:, None], starts)
    return Course(
        world="corridor",
        seed=seed,
        route=route,
        half_width=obstacles.half_width,
        walls=(*left, *right),
        obstacles=tuple(obstacles.obstacles),
        lamps=_lamps(rng, corners, widths),
        ceiling_m=_CEILING_M,
        gap_m=obstacles.gap_m,
    )


def _corners(rng: np.random.Generator) -> Array | None:
    """Corners of the route in driving direction, the longest leg first, m, (n, 2)."""
    points = random_loop(rng, int(rng.integers(3, 8)), _PITCH_M)
    if points is None:
        return None
    if rng.random() < 0.5:
        points = points[::-1]
    points = points[_turns(points) != 0]
    if len(points) < 6:  # A rectangle turns one way only.
        return None
    return np.roll(points, -int(np.argmax(_legs(points)[1])), axis=0)


def _turns(points: Array) -> NDArray[np.int64]:
    """Turn at each point: 1 to the left, -1 to the right, 0 for none."""
    return np.sign(np.round(turn_angles(points), 6)).astype(np.int64)


def _legs(corners: Array) -> tuple[Array, Array]:
    """Unit vector from each corner to the next, (n, 2), and distance, m, (n,)."""
    legs = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    return legs / lengths[:, None], lengths


def _route(corners: Array, widths: Array) -> tuple[Array, Array]:
    """Route with rounded corners, m, (m, 2), and the distance of each corner along it, m, (n,).

    The route starts after a third of the first leg. The radius of a corner is half the width of the
    lane, so the distance from the inner edge is constant.
    """
    ahead, _ = _legs(corners)
    back = np.roll(ahead, 1, axis=0)
    radii = np.minimum(widths, np.roll(widths, 1)) / 2.0
    pieces = [corners[:1] + (corners[1:2] - corners[:1]) / 3.0]
    angles = np.linspace(0.0, np.pi / 2.0, 25)[:, None]
    for k in [*range(1, len(corners)), 0]:
        arc = (1.0 - np.sin(angles)) * -back[k] + (1.0 - np.cos(angles)) * ahead[k]
        pieces.append(corners[k] + radii[k] * arc)
    line = np.concatenate(pieces)
    # The middle of a corner is the thirteenth point of its arc.
    along = arc_lengths(line)[np.arange(len(corners)) * 25 + 13]
    return resample(line, _SPACING_M), np.roll(along, 1)


def _furnish(
    rng: np.random.Generator,
    obstacles: LaneObstacles,
    corners: Array,
    normals: Array,
    widths: Array,
    along: Array,
) -> None:
    """Add furniture along the walls, and a few boxes in the way."""
    density = rng.uniform(0.1, 0.35)  # Obstacles per metre.
    ahead, lengths = _legs(corners)
    for k in range(len(corners)):
        length = float(lengths[k])
        yaw = float(np.arctan2(ahead[k, 1], ahead[k, 0]))
        for _ in range(rng.poisson(density * length)):
            size = _FURNITURE[weighted_choice(rng, [kind.share for kind in _FURNITURE])]
            t = float(rng.uniform(1.2, length - 1.2))
            side = 1.0 if rng.random() < 0.5 else -1.0
            obstacle = size.draw(rng, yaw)
            aside = widths[k] / 2.0 - obstacle.width / 2.0 - float(rng.uniform(0.005, 0.04))
            if obstacle.kind in ("box", "crate") and rng.random() < 0.4:
                aside *= float(rng.uniform(0.4, 0.9))
                obstacle = replace(obstacle, yaw=yaw + float(rng.uniform(-0.6, 0.6)))
            x, y = corners[k] + ahead[k] * t + normals[k] * side * aside
            obstacle = replace(obstacle, x=float(x), y=float(y))
            obstacles.offer(obstacle, float(along[(k + 1) % len(along)]) - (length - t))


def _plant(
    rng: np.random.Generator, obstacles: LaneObstacles, corners: Array, inward: Array, along: Array
) -> None:
    """Add plants and bins in some nooks; `inward` points from a nook through its corner."""
    for corner, way, s in zip(corners, inward, along, strict=True):
        if rng.random() < 0.25:
            size = _FURNITURE[3] if rng.random() < 0.7 else _FURNITURE[1]
            obstacle = size.draw(rng, 0.0)
            # The plant stands 2 cm from both walls.
            x, y = corner - way + np.sign(way) * (obstacle.length / 2.0 + 0.02)
            obstacles.offer(replace(obstacle, x=float(x), y=float(y)), float(s))


def _lamps(rng: np.random.Generator, corners: Array, widths: Array) -> tuple[Lamp, ...]:
    """Lamps along the middle of every leg, lengthwise or across."""
    every = float(rng.uniform(2.0, 3.2))
    long, wide = float(rng.uniform(0.9, 1.3)), float(rng.uniform(0.12, 0.3))
    across = rng.random() < 0.35
    lamps: list[Lamp] = []
    ahead, lengths = _legs(corners)
    for k in range(len(corners)):
        length = float(lengths[k])
        count = max(1, round(length / every))
        yaw = float(np.arctan2(ahead[k, 1], ahead[k, 0])) + (np.pi / 2.0 if across else 0.0)
        for i in range(count):
            x, y = corners[k] + ahead[k] * length * (i + 0.5) / count
            lamps.append(Lamp(float(x), float(y), yaw, min(long, 0.6 * float(widths[k])), wide))
    return tuple(lamps)
