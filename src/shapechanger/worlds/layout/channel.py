"""Winding lanes in the open: a smooth closed middle, and walls of many short pieces beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Surface, Wall
from shapechanger.worlds.layout.chance import picked
from shapechanger.worlds.layout.lines import (
    arcs,
    at,
    length,
    normals,
    resampled,
    smoothed,
    spaced,
    tangent_radii,
    turns,
)
from shapechanger.worlds.layout.loops import grown, outline, spread

__all__ = ["Channel", "Stretch", "banks", "dug"]

_FINE: Final = 1024
"""Points of the line while it is being shaped."""

_COARSE: Final = 128
"""Points of it that are compared with each other: each with all the others."""

_WIND_RAD: Final = 0.4
"""What a course turns to each side in sum, at least."""


@dataclass(frozen=True, slots=True)
class Channel:
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
class Stretch:
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


def dug(
    rng: np.random.Generator, shape: Channel, spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """One attempt at a middle line, (n, 2), m, and its distance from the banks, (n,), m.

    The corners of a loop on a grid are rounded more and more until the lane has room everywhere.

    None where chance made one that is too tight, or too near to itself.
    """
    loop = outline(grown(rng, int(rng.integers(shape.cells[0], shape.cells[1] + 1))))
    if loop is None:
        return None
    points = spread(rng, loop, *shape.pitch)
    points += rng.normal(0.0, 0.1 * shape.pitch[0], size=points.shape)
    if rng.random() < 0.5:
        points = points[::-1]
    turn = float(rng.uniform(-np.pi, np.pi))
    points = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    # A grid that is stretched too far would no longer have the lane's proportions.
    points *= float(np.clip(rng.uniform(*shape.length) / length(points), 0.8, 1.2))
    sharp = resampled(points, length(points) / _FINE)
    blur = shape.blur[0]
    while True:
        line = smoothed(sharp, blur * _FINE / length(points))
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
    first = int(np.argmin(smoothed(np.abs(turns(coarse)), 2.0)))
    line = np.roll(line, -first * (_FINE // _COARSE), axis=0)
    coarse, most = np.roll(coarse, -first, axis=0), np.roll(most, -first)
    low, high = shape.half_width
    # Wider and narrower every few metres, and never wider than the place allows.
    waves = smoothed(rng.normal(size=_COARSE), 3.0 * _COARSE / length(line))
    half = low + (high - low) * (0.5 + waves / (4.0 * float(waves.std())))
    half = smoothed(np.clip(np.minimum(half, most), low, high), 1.0)
    route = resampled(line, spacing)
    knots = arcs(coarse)
    s = spaced(float(knots[-1]), len(route))
    return route, at(half[:, None], knots, s)[:, 0]


def _winds(line: NDArray[np.float64]) -> bool:
    """Whether a line turns to the left somewhere and to the right elsewhere, enough to be felt."""
    turned = turns(line)
    return bool(turned[turned > 0.0].sum() > _WIND_RAD < -turned[turned < 0.0].sum())


def banks(
    rng: np.random.Generator,
    route: NDArray[np.float64],
    half_width: NDArray[np.float64],
    kinds: tuple[Stretch, ...],
) -> tuple[tuple[Wall, ...], tuple[Wall, ...]]:
    """Walls at the left hand and at the right hand of a lane, each a closed line."""
    aside = normals(route) * half_width[:, None]
    left = _bank(rng, (route + aside)[::-1], kinds)
    return left, _bank(rng, route - aside, kinds)


def _bank(
    rng: np.random.Generator, line: NDArray[np.float64], kinds: tuple[Stretch, ...]
) -> tuple[Wall, ...]:
    """Walls along a closed line, with the lane at the left hand."""
    knots = arcs(line)
    shares = [kind.share for kind in kinds]
    ends: list[float] = []
    chosen: list[Stretch] = []
    heights: list[float] = []
    s = 0.0
    while s < knots[-1]:
        kind = kinds[picked(rng, shares)]
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
    points = at(line, knots, at_s)
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
