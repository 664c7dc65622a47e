"""Winding lanes in the open: a smooth closed middle, and walls of many short pieces beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Course, Surface, Wall
from shapechanger.worlds.layout.furniture import (
    Lane,
    LaneObstacles,
    Scatter,
    Size,
    place_sun_patches,
    scatter_obstacles,
    weighted_choice,
)
from shapechanger.worlds.layout.geometry import (
    any_crossing,
    arc_lengths,
    even_distances,
    grow_cells,
    interpolate,
    length,
    normals,
    resample,
    scale_grid,
    smooth,
    tangent_radii,
    trace_outline,
    turn_angles,
    wall_segments,
)

__all__ = ["QUAY_M", "BankKind", "ChannelShape", "build_banks", "dig_channel", "harbour", "yard"]

_FINE: Final = 1024
"""Points of the line while it is being shaped."""

_COARSE: Final = 128
"""Points of it that are compared with each other: each with all the others."""

_WIND_RAD: Final = 0.4
"""What a course turns to each side in sum, at least."""


@dataclass(frozen=True, slots=True)
class ChannelShape:
    """Bounds of a lane's shape, m.

    Attributes:
        pitch: Of the grid that it comes from.
        cells: How many squares it goes round.
        blur: How far its corners are rounded, at least and at most.
        length: Once round.
        radius: Of the tightest bend, at least.
        half_width: From the middle to either side.
        wall: Left between two parts of the lane, on each side of the line between them.
    """

    pitch: tuple[float, float]
    cells: tuple[int, int]
    blur: tuple[float, float]
    length: tuple[float, float]
    radius: float
    half_width: tuple[float, float]
    wall: float


@dataclass(frozen=True, slots=True)
class BankKind:
    """What a piece of the bank may be.

    Attributes:
        surface: What it is made of.
        share: How often it is chosen.
        run: How long it goes on, m.
        piece: How long each straight wall of it is, m.
        height: Above the ground or the water, m.
        rough: How far its corners stand back from the bank at most, m.
    """

    surface: Surface
    share: float
    run: tuple[float, float]
    piece: float
    height: tuple[float, float]
    rough: float = 0.0


def dig_channel(
    rng: np.random.Generator, shape: ChannelShape, spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """One attempt at a middle line, (n, 2), m, and its distance from the banks, (n,), m.

    The corners of a loop on a grid are rounded more and more until the lane has room everywhere.

    None where chance made one that is too tight, or too near to itself.
    """
    loop = trace_outline(grow_cells(rng, int(rng.integers(shape.cells[0], shape.cells[1] + 1))))
    if loop is None:
        return None
    points = scale_grid(rng, loop, *shape.pitch)
    points += rng.normal(0.0, 0.1 * shape.pitch[0], size=points.shape)
    if rng.random() < 0.5:
        points = points[::-1]
    turn = float(rng.uniform(-np.pi, np.pi))
    points = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    # A grid that is stretched too far would no longer have the lane's proportions.
    points *= float(np.clip(rng.uniform(*shape.length) / length(points), 0.8, 1.2))
    sharp = resample(points, length(points) / _FINE)
    blur = shape.blur[0]
    while True:
        line = smooth(sharp, blur * _FINE / length(points))
        coarse = line[:: _FINE // _COARSE]
        room = tangent_radii(coarse)
        most = np.minimum(0.85 * room, room - shape.wall)
        if room.min() >= shape.radius and most.min() >= shape.half_width[0]:
            break
        blur *= 1.2
        if blur > shape.blur[1]:
            return None
    if not shape.length[0] <= length(line) <= shape.length[1] or not _winds(coarse):
        return None
    # It begins where it is straight, so that a vehicle can start there.
    first = int(np.argmin(smooth(np.abs(turn_angles(coarse)), 2.0)))
    line = np.roll(line, -first * (_FINE // _COARSE), axis=0)
    coarse, most = np.roll(coarse, -first, axis=0), np.roll(most, -first)
    low, high = shape.half_width
    # Wider and narrower every few metres, and never wider than the place allows.
    waves = smooth(rng.normal(size=_COARSE), 3.0 * _COARSE / length(line))
    half = low + (high - low) * (0.5 + waves / (4.0 * float(waves.std())))
    half = smooth(np.clip(np.minimum(half, most), low, high), 1.0)
    route = resample(line, spacing)
    knots = arc_lengths(coarse)
    s = even_distances(float(knots[-1]), len(route))
    return route, interpolate(half[:, None], knots, s)[:, 0]


def _winds(line: NDArray[np.float64]) -> bool:
    """Whether a line turns to the left somewhere and to the right elsewhere, enough to be felt."""
    turned = turn_angles(line)
    return bool(turned[turned > 0.0].sum() > _WIND_RAD < -turned[turned < 0.0].sum())


def build_banks(
    rng: np.random.Generator,
    route: NDArray[np.float64],
    half_width: NDArray[np.float64],
    kinds: tuple[BankKind, ...],
) -> tuple[tuple[Wall, ...], tuple[Wall, ...]]:
    """Walls at the left hand and at the right hand of a lane, each a closed line."""
    aside = normals(route) * half_width[:, None]
    left = _bank(rng, (route + aside)[::-1], kinds)
    return left, _bank(rng, route - aside, kinds)


def _bank(
    rng: np.random.Generator, line: NDArray[np.float64], kinds: tuple[BankKind, ...]
) -> tuple[Wall, ...]:
    """Walls along a closed line, with the lane at the left hand."""
    knots = arc_lengths(line)
    shares = [kind.share for kind in kinds]
    ends: list[float] = []
    chosen: list[BankKind] = []
    heights: list[float] = []
    s = 0.0
    while s < knots[-1]:
        kind = kinds[weighted_choice(rng, shares)]
        count = max(1, round(float(rng.uniform(*kind.run)) / kind.piece))
        height = float(rng.uniform(*kind.height))
        for _ in range(count):
            s += kind.piece
            ends.append(s)
            chosen.append(kind)
            heights.append(height)
            if s >= knots[-1]:
                break
    # Squeezed a little so that the last piece ends where the first begins.
    at_s = np.array(ends) * (knots[-1] / s)
    points = interpolate(line, knots, at_s)
    back = -normals(line)[np.searchsorted(knots[:-1], at_s % knots[-1]) % len(line)]
    rough = np.array(
        [min(a.rough, b.rough) for a, b in zip(chosen, [*chosen[1:], chosen[0]], strict=True)]
    )
    points += back * (rng.uniform(0.0, 1.0, len(points)) * rough)[:, None]
    return tuple(
        Wall(
            (float(points[i - 1, 0]), float(points[i - 1, 1])),
            (float(points[i, 0]), float(points[i, 1])),
            heights[i],
            kind.surface,
        )
        for i, kind in enumerate(chosen)
    )


_SHAPE: Final = ChannelShape(
    pitch=(5.5, 8.0),
    cells=(3, 5),
    blur=(2.1, 4.5),
    length=(40.0, 88.0),
    radius=1.9,
    half_width=(1.6, 2.45),
    wall=0.25,
)
_GAP_M = 1.2
_SPACING_M = 0.1

_BANKS = (
    BankKind("hedge", 0.4, (3.0, 12.0), 1.0, (0.9, 1.9)),
    BankKind("fence", 0.25, (3.0, 10.0), 1.3, (0.9, 1.6)),
    BankKind("brick", 0.2, (2.5, 8.0), 1.2, (1.2, 2.2)),
    BankKind("shed", 0.15, (2.0, 4.0), 1.6, (2.1, 2.5)),
)

_OBSTACLES = (
    Scatter(Size("cone", (0.22, 0.34), (0.22, 0.34), (0.4, 0.7)), 0.3),
    Scatter(Size("crate", (0.35, 0.6), (0.3, 0.45), (0.25, 0.5)), 0.2),
    Scatter(Size("bin", (0.4, 0.55), (0.4, 0.55), (0.8, 1.1)), 0.15),
    Scatter(Size("post", (0.08, 0.16), (0.08, 0.16), (0.7, 1.2)), 0.15),
    Scatter(Size("tree", (0.2, 0.4), (0.2, 0.4), (2.5, 4.0)), 0.2),
)


def yard(rng: np.random.Generator, seed: int) -> Course | None:
    """One attempt at a course; None where chance made none that fits."""
    shape = dig_channel(rng, _SHAPE, _SPACING_M)
    if shape is None:
        return None
    lane = Lane(shape[0], *build_banks(rng, *shape, _BANKS))
    if any_crossing(wall_segments((*lane.left, *lane.right))):
        return None
    half_width = lane.half_width()
    if half_width.min() < 1.5 or half_width.max() > 2.5:
        return None
    obstacles = LaneObstacles(lane, half_width, _GAP_M)
    scatter_obstacles(rng, obstacles, _OBSTACLES, per_m=float(rng.uniform(0.12, 0.4)))
    return Course(
        world="yard",
        seed=seed,
        route=lane.route,
        half_width=half_width,
        walls=(*lane.left, *lane.right),
        obstacles=tuple(obstacles.obstacles),
        lamps=place_sun_patches(rng, lane.route, half_width),
        ceiling_m=0.0,
        gap_m=obstacles.gap_m,
    )


QUAY_M: Final = 0.6
"""Height of a quay above the water."""

_HARBOUR_SHAPE: Final = ChannelShape(
    pitch=(7.0, 10.5),
    cells=(3, 4),
    blur=(2.6, 6.0),
    length=(48.0, 88.0),
    radius=2.6,
    half_width=(2.15, 3.4),
    wall=0.45,
)
_HARBOUR_GAP_M = 1.6
_MOST_CURRENT_MPS = 0.15

_HARBOUR_BANKS = (
    BankKind("quay", 0.7, (5.0, 16.0), 2.0, (QUAY_M, QUAY_M)),
    BankKind("rock", 0.3, (2.5, 8.0), 0.8, (0.35, 0.9), rough=0.35),
)

_HARBOUR_OBSTACLES = (
    Scatter(Size("buoy", (0.35, 0.6), (0.35, 0.6), (0.5, 0.9)), 0.4),
    Scatter(Size("crate", (0.4, 0.7), (0.4, 0.6), (0.25, 0.4)), 0.25),
    # Dinghies lie along the quay.
    Scatter(Size("dinghy", (1.4, 2.0), (0.7, 0.9), (0.4, 0.5)), 0.35, moored=0.75),
)


def harbour(rng: np.random.Generator, seed: int) -> Course | None:
    """One attempt at a course; None where chance made none that fits."""
    shape = dig_channel(rng, _HARBOUR_SHAPE, _SPACING_M)
    if shape is None:
        return None
    lane = Lane(shape[0], *build_banks(rng, *shape, _HARBOUR_BANKS))
    if any_crossing(wall_segments((*lane.left, *lane.right))):
        return None
    half_width = lane.half_width()
    if half_width.min() < 2.0 or half_width.max() > 3.5:
        return None
    obstacles = LaneObstacles(lane, half_width, _HARBOUR_GAP_M)
    scatter_obstacles(rng, obstacles, _HARBOUR_OBSTACLES, per_m=float(rng.uniform(0.08, 0.25)))
    speed = float(rng.uniform(0.0, _MOST_CURRENT_MPS))
    where = float(rng.uniform(-np.pi, np.pi))
    return Course(
        world="harbour",
        seed=seed,
        route=lane.route,
        half_width=half_width,
        walls=(*lane.left, *lane.right),
        obstacles=tuple(obstacles.obstacles),
        lamps=place_sun_patches(rng, lane.route, half_width),
        ceiling_m=0.0,
        gap_m=obstacles.gap_m,
        current_mps=(speed * float(np.cos(where)), speed * float(np.sin(where))),
    )
