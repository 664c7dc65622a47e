"""Yards and harbours: winding lanes along a smooth route, between walls of short pieces."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec
import numpy as np

from shapechanger.vehicles.courses.course import Course, Surface, Wall
from shapechanger.vehicles.courses.furniture import (
    LaneObstacles,
    Scatter,
    place_sun_patches,
    scatter_obstacles,
    weighted_choice,
)
from shapechanger.vehicles.courses.geometry import (
    Array,
    any_crossing,
    arc_lengths,
    even_distances,
    interpolate,
    length,
    normals,
    random_loop,
    resample,
    smooth,
    tangent_radii,
    turn_angles,
    wall_segments,
)

# Number of points of the route while it is shaped, and while its pairwise distances are computed.
_FINE, _COARSE = 1024, 128
_SPACING_M: Final = 0.1
_WIND_RAD: Final = 0.4  # Smallest sum of the left turns, and of the right turns, of a route.


@dataclass(frozen=True, slots=True)
class BankKind:
    """A kind of bank; `open_worlds.toml` describes the fields."""

    surface: Surface
    share: float
    run: tuple[float, float]
    piece: float
    height: tuple[float, float]
    rough: float = 0.0


@dataclass(frozen=True, slots=True)
class OpenWorld:
    """A kind of course in the open; `open_worlds.toml` describes the fields."""

    pitch: tuple[float, float]
    cells: tuple[int, int]
    blur: tuple[float, float]
    length: tuple[float, float]
    radius: float
    dug: tuple[float, float]
    wall: float
    half_width: tuple[float, float]
    banks: tuple[BankKind, ...]
    obstacles: tuple[Scatter, ...]
    per_m: tuple[float, float]
    gap_m: float
    current_mps: float = 0.0


def _dig_channel(rng: np.random.Generator, world: OpenWorld) -> tuple[Array, Array] | None:
    """Try to lay out a route: points, m, (n, 2), and distance from the banks, m, (n,).

    The corners of a loop on a grid are smoothed more and more until the lane fits everywhere.
    Returns None if the random loop is too tight or too close to itself.
    """
    points = random_loop(rng, int(rng.integers(world.cells[0], world.cells[1] + 1)), world.pitch)
    if points is None:
        return None
    points += rng.normal(0.0, 0.1 * world.pitch[0], size=points.shape)
    if rng.random() < 0.5:
        points = points[::-1]
    turn = float(rng.uniform(-np.pi, np.pi))
    points = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    # Scaling the grid too much would spoil the proportions of the lane.
    points *= float(np.clip(rng.uniform(*world.length) / length(points), 0.8, 1.2))
    sharp = resample(points, length(points) / _FINE)
    blur = world.blur[0]
    while True:
        line = smooth(sharp, blur * _FINE / length(points))
        coarse = line[:: _FINE // _COARSE]
        room = tangent_radii(coarse)
        most = np.minimum(0.85 * room, room - world.wall)
        if room.min() >= world.radius and most.min() >= world.dug[0]:
            break
        blur *= 1.2
        if blur > world.blur[1]:
            return None
    turned = turn_angles(coarse)
    winds = turned[turned > 0.0].sum() > _WIND_RAD < -turned[turned < 0.0].sum()
    if not winds or not world.length[0] <= length(line) <= world.length[1]:
        return None
    # The route starts on a straight.
    first = int(np.argmin(smooth(np.abs(turned), 2.0)))
    line = np.roll(line, -first * (_FINE // _COARSE), axis=0)
    coarse, most = np.roll(coarse, -first, axis=0), np.roll(most, -first)
    low, high = world.dug
    # The width varies every few metres, within the available space.
    waves = smooth(rng.normal(size=_COARSE), 3.0 * _COARSE / length(line))
    half = low + (high - low) * (0.5 + waves / (4.0 * float(waves.std())))
    half = smooth(np.clip(np.minimum(half, most), low, high), 1.0)
    route = resample(line, _SPACING_M)
    knots = arc_lengths(coarse)
    s = even_distances(float(knots[-1]), len(route))
    return route, interpolate(half[:, None], knots, s)[:, 0]


def _bank(rng: np.random.Generator, line: Array, kinds: tuple[BankKind, ...]) -> tuple[Wall, ...]:
    """Walls of randomly drawn kinds along a closed line, with the lane on its left."""
    knots = arc_lengths(line)
    shares = [kind.share for kind in kinds]
    ends: list[float] = []
    pieces: list[tuple[BankKind, float]] = []  # Kind and height, m, of each piece.
    s = 0.0
    while s < knots[-1]:
        kind = kinds[weighted_choice(rng, shares)]
        count = max(1, round(float(rng.uniform(*kind.run)) / kind.piece))
        height = float(rng.uniform(*kind.height))
        while count and s < knots[-1]:
            s += kind.piece
            count -= 1
            ends.append(s)
            pieces.append((kind, height))
    # The pieces are scaled so that the last one ends where the first begins.
    at_s = np.array(ends) * (knots[-1] / s)
    points = interpolate(line, knots, at_s)
    back = -normals(line)[np.searchsorted(knots[:-1], at_s % knots[-1]) % len(line)]
    each = np.array([kind.rough for kind, _ in pieces])
    rough = np.minimum(each, np.roll(each, -1))
    points += back * (rng.uniform(0.0, 1.0, len(points)) * rough)[:, None]
    return tuple(
        Wall.between(points[i - 1], points[i], height, kind.surface)
        for i, (kind, height) in enumerate(pieces)
    )


_WORLDS: Final = msgspec.convert(
    tomllib.loads(Path(__file__).with_name("open_worlds.toml").read_text("utf-8")),
    dict[str, OpenWorld],
)


def open_course(name: str, rng: np.random.Generator, seed: int) -> Course | None:
    """Try to lay out a yard or a harbour; None if the random layout does not fit."""
    world = _WORLDS[name]
    channel = _dig_channel(rng, world)
    if channel is None:
        return None
    route, aside = channel[0], normals(channel[0]) * channel[1][:, None]
    left = _bank(rng, (route + aside)[::-1], world.banks)
    right = _bank(rng, route - aside, world.banks)
    if any_crossing(wall_segments((*left, *right))):
        return None
    obstacles = LaneObstacles(route, left, right, world.gap_m)
    half_width = obstacles.half_width
    if half_width.min() < world.half_width[0] or half_width.max() > world.half_width[1]:
        return None
    scatter_obstacles(rng, obstacles, world.obstacles, per_m=float(rng.uniform(*world.per_m)))
    current = (0.0, 0.0)
    if world.current_mps:
        speed = float(rng.uniform(0.0, world.current_mps))
        angle = float(rng.uniform(-np.pi, np.pi))
        current = (speed * float(np.cos(angle)), speed * float(np.sin(angle)))
    return Course(
        world=name,
        seed=seed,
        route=route,
        half_width=half_width,
        walls=(*left, *right),
        obstacles=tuple(obstacles.obstacles),
        lamps=place_sun_patches(rng, route, half_width),
        ceiling_m=0.0,
        gap_m=obstacles.gap_m,
        current_mps=current,
    )
