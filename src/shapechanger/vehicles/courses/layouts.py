"""Random layouts of courses: corridors, and lanes in the open.

Corridors have straight legs, right-angled corners and panelled walls. Yards and harbours wind along
a smooth route, between walls of short pieces.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.vehicles.courses.course import Course, Lamp, Surface, Wall
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

_SPACING_M: Final = 0.1  # Distance between the points of a route.
_DOOR_M: Final = 0.9 + 2 * 0.06  # Width of a door with its frame.
_RECESS_M: Final = 0.15  # Depth of a recessed door.
_PLAIN_M: Final = (0.4, 2.4)  # Range of the length of plaster between two panels.

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
    1 for corners that project into the lane, and -1 for corners that recede from it.
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
_GAP_M: Final = 0.9  # Smallest gap on the wider side of an obstacle.

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
    """Add plants and bins in some corners that recede; `inward` vectors point into the lane."""
    for corner, way, s in zip(corners, inward, along, strict=True):
        if rng.random() < 0.25:
            size = _FURNITURE[3] if rng.random() < 0.7 else _FURNITURE[1]
            obstacle = size.draw(rng, 0.0)
            # The obstacle stands 2 cm from both walls.
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


# Number of points of the route while it is shaped, and while its pairwise distances are computed.
_FINE, _COARSE = 1024, 128
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
    Returns None if the loop is too tight, too close to itself, too long or too short, or if it
    turns almost only one way.
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
