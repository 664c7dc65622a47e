"""Properties of all courses, training and held-out, and starts on them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from shapechanger.errors import UnknownName, WorldError
from shapechanger.vehicles.courses import WORLDS, lay_out, start_pose
from shapechanger.vehicles.courses.course import FLOODED, HELD_OUT, Course, Obstacle
from shapechanger.vehicles.courses.geometry import (
    any_crossing,
    distances_from_obstacle,
    distances_to_segments,
    wall_segments,
)

_SEEDS = [*range(20), *HELD_OUT[:20]]
_WIDTHS = {"corridor": (1.8, 2.4), "yard": (3.0, 5.0), "harbour": (4.0, 7.0)}
_GAPS = {"corridor": 0.9, "yard": 1.2, "harbour": 1.6}

each_world = pytest.mark.parametrize("world", tuple(_WIDTHS))


@cache
def _laid(world: str, seed: int) -> Course:
    return lay_out(world, seed)


def _courses(world: str) -> list[Course]:
    return [_laid(world, seed) for seed in _SEEDS]


def _same(one: Course, other: Course) -> bool:
    return (
        np.array_equal(one.route, other.route)
        and np.array_equal(one.half_width, other.half_width)
        and (one.walls, one.obstacles, one.lamps) == (other.walls, other.obstacles, other.lamps)
        and (one.gap_m, one.current_mps) == (other.gap_m, other.current_mps)
    )


@each_world
def test_the_seed_determines_the_course(world: str) -> None:
    for seed in _SEEDS[:5] + _SEEDS[-5:]:
        np.random.seed(seed % 7)  # noqa: NPY002 - The global state must not matter.
        assert _same(lay_out(world, seed), _laid(world, seed))
    courses = _courses(world)
    assert not any(_same(a, b) for i, a in enumerate(courses) for b in courses[:i])


@pytest.mark.parametrize("seed", [0, HELD_OUT[0]])
def test_a_flooded_corridor_has_the_courses_of_the_corridor(seed: int) -> None:
    """Only the name of the world differs, so that a boat and a car drive the same lanes."""
    flooded = lay_out(FLOODED, seed)
    assert _same(flooded, _laid("corridor", seed))
    assert flooded.world == FLOODED


@each_world
def test_the_route_is_closed_and_evenly_spaced(world: str) -> None:
    for course in _courses(world):
        steps = np.diff(course.route, axis=0, append=course.route[:1])
        chords = np.hypot(steps[:, 0], steps[:, 1])
        assert chords == pytest.approx(course.spacing, rel=2e-3)
        assert course.spacing == pytest.approx(0.1, rel=0.02)
        assert 40.0 <= course.length <= 90.0
        assert course.half_width.shape == (len(course.route),)


@each_world
def test_walls_form_closed_lines(world: str) -> None:
    for course in _courses(world):
        starts = [wall.start for wall in course.walls]
        ends = [wall.end for wall in course.walls]
        assert len(set(starts)) == len(starts)
        assert sorted(starts) == sorted(ends)
        lengths = [math.dist(wall.start, wall.end) for wall in course.walls]
        assert min(lengths) > 0.05
        assert not any_crossing(wall_segments(course.walls))


@each_world
def test_walls_face_the_route(world: str) -> None:
    """From the route, every ray hits the front of a wall."""
    angles = np.linspace(0.0, 2 * math.pi, 90, endpoint=False) + 0.0123
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for course in _courses(world)[::3]:
        feet = wall_segments(course.walls)
        along = feet[:, 2:] - feet[:, :2]
        for eye in course.route[::40]:
            to = feet[:, :2] - eye
            across = ways[:, :1] * along[:, 1] - ways[:, 1:] * along[:, 0]
            far = (to[:, 0] * along[:, 1] - to[:, 1] * along[:, 0]) / across
            share = (to[:, 0] * ways[:, 1:] - to[:, 1] * ways[:, :1]) / across
            hit = (far > 0.0) & (share >= 0.0) & (share <= 1.0)
            assert hit.any(axis=1).all()
            nearest = np.where(hit, far, np.inf).argmin(axis=1)
            # Rays come from the left of the wall and cross to its right.
            assert (across[np.arange(len(ways)), nearest] > 0.0).all()


@each_world
def test_half_width_is_the_distance_to_the_walls(world: str) -> None:
    low, high = _WIDTHS[world]
    for course in _courses(world):
        nearest = distances_to_segments(course.route, wall_segments(course.walls)).min(axis=1)
        assert course.half_width == pytest.approx(nearest, abs=1e-6)
        assert nearest.min() >= low / 2.0 - 1e-6
        # A corner of a corridor is as wide as its diagonal.
        assert nearest.max() <= high / 2.0 * (math.sqrt(2.0) if world == "corridor" else 1.0)


@each_world
def test_the_whole_lane_has_the_promised_gap(world: str) -> None:
    """A disc of diameter `gap_m` fits around the course on an occupancy grid."""
    cell = 0.04
    for course in _courses(world)[::2]:
        assert course.gap_m >= _GAPS[world]
        blocked, (x0, y0) = occupancy(course, cell)
        room = ndimage.distance_transform_edt(~blocked) * cell
        free = room >= course.gap_m / 2.0 - 1.5 * cell
        # Cut the lane at the start: both sides must be connected around the course.
        ahead = course.route[1] - course.route[-1]
        ahead /= np.hypot(*ahead)
        rows, columns = np.indices(blocked.shape)
        x, y = x0 + columns * cell - course.route[0, 0], y0 + rows * cell - course.route[0, 1]
        s, aside = x * ahead[0] + y * ahead[1], y * ahead[0] - x * ahead[1]
        near = np.abs(aside) < 1.3 * float(course.half_width[0])
        free &= ~(near & (np.abs(s) < 1.5 * cell))
        labels, _ = ndimage.label(free)
        after = set(labels[near & (s > 0.0) & (s < 0.5)].flat) - {0}
        before = set(labels[near & (s < 0.0) & (s > -0.5)].flat) - {0}
        assert after & before


def test_yards_and_harbours_have_every_kind() -> None:
    """Over all seeds every surface and obstacle occurs, and quays have their height."""
    yards, harbours = _courses("yard"), _courses("harbour")
    assert {w.surface for c in yards for w in c.walls} == {"hedge", "fence", "brick", "shed"}
    assert {t.kind for c in yards for t in c.obstacles} == {"cone", "crate", "bin", "post", "tree"}
    assert {w.surface for c in harbours for w in c.walls} == {"quay", "rock"}
    assert {t.kind for c in harbours for t in c.obstacles} == {"buoy", "dinghy", "crate"}
    quays = {w.height for c in harbours for w in c.walls if w.surface == "quay"}
    assert quays == {0.6}


def test_unknown_worlds_and_seeds_are_refused() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'harbour'"):
        lay_out("harbor", 0)
    with pytest.raises(WorldError, match="from 0, got -1"):
        lay_out("yard", -1)


def test_a_layout_that_never_fits_raises(monkeypatch: pytest.MonkeyPatch) -> None:

    def never(world: str, rng: np.random.Generator, seed: int) -> Course | None:
        return None

    monkeypatch.setattr("shapechanger.vehicles.courses.open_course", never)
    with pytest.raises(WorldError, match="No yard with seed 3"):
        lay_out("yard", 3)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("seed", [0, 7, HELD_OUT[3]])
def test_starts_are_on_the_route_and_free(world: str, seed: int) -> None:
    """A truck with its trailer fits at each start, facing along the lane."""
    course = lay_out(world, seed)
    poses = {start_pose(course, k) for k in range(30)}
    assert len(poses) > 10
    assert poses == {start_pose(course, k) for k in range(30)}
    for pose in poses:
        far = np.hypot(course.route[:, 0] - pose.x, course.route[:, 1] - pose.y)
        i = int(far.argmin())
        assert far[i] == pytest.approx(0.0, abs=1e-9)
        step = course.route[(i + 1) % len(far)] - course.route[i]
        turned = math.atan2(step[1], step[0]) - pose.heading
        assert abs((turned + math.pi) % (2 * math.pi) - math.pi) < 0.1
        # One metre of vehicle and trailer, 0.24 m wide, from 0.3 m before the pose backwards.
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        body = Obstacle(
            "box", pose.x - 0.25 * cos, pose.y - 0.25 * sin, pose.heading, 1.1, 0.24, 0.2
        )
        assert distances_from_obstacle(body, wall_segments(course.walls)).min() > 0.3
        ahead = course.route[np.arange(i, i + 20) % len(far)]
        pieces = np.concatenate([ahead[:-1], ahead[1:]], axis=1)
        assert all(
            distances_from_obstacle(obstacle, pieces).min() > 0.3 for obstacle in course.obstacles
        )


def test_a_full_lane_starts_at_its_first_point() -> None:
    course = lay_out("corridor", 0)
    full = replace(
        course,
        obstacles=tuple(Obstacle("bin", x, y, 0.0, 0.3, 0.3, 0.5) for x, y in course.route[::10]),
    )
    pose = start_pose(full, 3)
    assert (pose.x, pose.y) == tuple(course.route[0])


def occupancy(course: Course, cell_m: float) -> tuple[NDArray[np.bool_], tuple[float, float]]:
    """Return a grid of cells, and x and y of the centre of cell [0, 0], m.

    Cells are True if their centre is outside the lane or in an obstacle; rows go along y and
    columns along x.
    """
    feet = wall_segments(course.walls)
    low = np.minimum(feet[:, :2], feet[:, 2:]).min(axis=0) - 1.5 * cell_m
    high = np.maximum(feet[:, :2], feet[:, 2:]).max(axis=0) + 1.5 * cell_m
    columns, rows = (int(n) + 1 for n in np.ceil((high - low) / cell_m))
    x0, y0 = float(low[0]), float(low[1])
    y = y0 + cell_m * np.arange(rows)
    # Along a row, cells after an odd number of walls are inside.
    x1, y1, x2, y2 = np.hsplit(feet, 4)
    wall, row = np.nonzero((y1 <= y) != (y2 <= y))
    share = (y[row] - y1[wall, 0]) / (y2[wall, 0] - y1[wall, 0])
    x = x1[wall, 0] + share * (x2[wall, 0] - x1[wall, 0])
    crossings = np.zeros((rows, columns), dtype=np.int32)
    np.add.at(crossings, (row, np.ceil((x - x0) / cell_m).astype(np.intp)), 1)
    blocked = np.cumsum(crossings, axis=1) % 2 == 0
    for obstacle in course.obstacles:
        _fill(blocked, obstacle, x0, y0, cell_m)
    return blocked, (x0, y0)


def _fill(
    blocked: NDArray[np.bool_], obstacle: Obstacle, x0: float, y0: float, cell_m: float
) -> None:
    reach = float(np.hypot(obstacle.length, obstacle.width)) / 2.0
    rows, columns = blocked.shape
    c1 = max(0, int((obstacle.x - reach - x0) / cell_m))
    c2 = min(columns, int((obstacle.x + reach - x0) / cell_m) + 2)
    r1 = max(0, int((obstacle.y - reach - y0) / cell_m))
    r2 = min(rows, int((obstacle.y + reach - y0) / cell_m) + 2)
    x = x0 - obstacle.x + cell_m * np.arange(c1, c2, dtype=np.float64)[None, :]
    y = y0 - obstacle.y + cell_m * np.arange(r1, r2, dtype=np.float64)[:, None]
    if obstacle.is_round:
        inside = np.hypot(x, y) <= obstacle.length / 2.0
    else:
        c, s = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
        inside = np.abs(x * c + y * s) <= obstacle.length / 2.0
        inside &= np.abs(y * c - x * s) <= obstacle.width / 2.0
    blocked[r1:r2, c1:c2] |= inside
