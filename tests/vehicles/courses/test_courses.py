"""Properties of courses, starts, and the geometry of lines and obstacles."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import ndimage

from shapechanger.errors import UnknownName, WorldError
from shapechanger.vehicles.courses import WORLDS, lay_out, start_pose
from shapechanger.vehicles.courses.course import FLOODED, HELD_OUT, Course, Obstacle
from shapechanger.vehicles.courses.geometry import (
    ClearanceField,
    any_crossing,
    distances_from_obstacle,
    distances_to_segments,
    trace_outline,
    wall_segments,
)
from tests.vehicles.courses.scenes import in_lane

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
    """A boat and a car drive in the same lanes."""
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
        assert 40.0 <= chords.sum() <= 90.0
        assert course.half_width.shape == (len(course.route),)


@each_world
def test_walls_form_closed_lines_that_face_the_lane(world: str) -> None:
    """The visible side of a wall is on the left of its direction."""
    for course in _courses(world):
        feet = wall_segments(course.walls)
        starts, ends = feet[:, :2], feet[:, 2:]
        assert len({tuple(start) for start in starts}) == len(starts)
        assert sorted(map(tuple, starts)) == sorted(map(tuple, ends))
        along = ends - starts
        lengths = np.hypot(*along.T)
        assert lengths.min() > 0.05
        assert not any_crossing(feet)
        left = np.stack([-along[:, 1], along[:, 0]], axis=1) / lengths[:, None]
        middle = (starts + ends) / 2.0
        assert in_lane(course, middle + 0.01 * left).all()
        assert not in_lane(course, middle - 0.01 * left).any()


@each_world
def test_half_width_is_the_distance_from_the_walls(world: str) -> None:
    low, high = _WIDTHS[world]
    for course in _courses(world):
        nearest = distances_to_segments(course.route, wall_segments(course.walls)).min(axis=1)
        assert course.half_width == pytest.approx(nearest, abs=1e-6)
        assert nearest.min() >= low / 2.0 - 1e-6
        # A corner of a corridor is as wide as its diagonal.
        assert nearest.max() <= high / 2.0 * (math.sqrt(2.0) if world == "corridor" else 1.0)


@each_world
def test_the_lane_has_its_gap_everywhere(world: str) -> None:
    """A disc of diameter `gap_m` can be moved around the course, past all obstacles."""
    step_m = 0.04
    for course in _courses(world)[::2]:
        assert course.gap_m >= _GAPS[world]
        ahead = np.roll(course.route, -1, axis=0) - np.roll(course.route, 1, axis=0)
        ahead /= np.hypot(*ahead.T)[:, None]
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        aside = np.arange(-0.5 * _WIDTHS[world][1], 0.5 * _WIDTHS[world][1], step_m)
        places = course.route[:, None] + aside[:, None] * left[:, None]
        room = ClearanceField(course).distance(places.reshape(-1, 2)).reshape(places.shape[:2])
        inside = np.abs(aside) < course.half_width[:, None]
        free = inside & (room >= course.gap_m / 2.0 - 1.5 * step_m)
        labels, _ = ndimage.label(np.concatenate([free, free[:1]]))
        assert set(labels[0]) & set(labels[-1]) - {0}


def test_yards_and_harbours_have_every_kind() -> None:
    """Every surface and obstacle occurs in some course, and quays are 0.6 m high."""
    for world, surfaces, obstacles in (
        ("yard", {"hedge", "fence", "brick", "shed"}, {"cone", "crate", "bin", "post", "tree"}),
        ("harbour", {"quay", "rock"}, {"buoy", "dinghy", "crate"}),
    ):
        walls = [wall for course in _courses(world) for wall in course.walls]
        assert {wall.surface for wall in walls} == surfaces
        assert {o.kind for course in _courses(world) for o in course.obstacles} == obstacles
        assert {wall.height for wall in walls if wall.surface == "quay"} <= {0.6}


def test_impossible_courses_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UnknownName, match="Did you mean 'harbour'"):
        lay_out("harbor", 0)
    with pytest.raises(WorldError, match="at least 0, got -1"):
        lay_out("yard", -1)
    monkeypatch.setattr("shapechanger.vehicles.courses.open_course", lambda *_: None)
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
        # A vehicle with a trailer, 1.1 m long and 0.24 m wide; its nose is 0.3 m ahead of the pose.
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


def test_without_a_free_start_the_first_point_is_used() -> None:
    course = lay_out("corridor", 0)
    full = replace(
        course,
        obstacles=tuple(Obstacle("bin", x, y, 0.0, 0.3, 0.3, 0.5) for x, y in course.route[::10]),
    )
    pose = start_pose(full, 3)
    assert (pose.x, pose.y) == tuple(course.route[0])


@pytest.mark.parametrize(
    "cells",
    [
        frozenset({(0, 0), (1, 1)}),
        frozenset({(x, y) for x in range(3) for y in range(3)} - {(1, 1)}),
        frozenset({(0, 0), (5, 5)}),
    ],
    ids=["a corner touches", "a hole", "two pieces"],
)
def test_outlines_that_are_not_one_loop_are_refused(cells: frozenset[tuple[int, int]]) -> None:
    assert trace_outline(cells) is None


def test_segments_that_share_an_end_do_not_cross() -> None:
    chain = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    tie = chain[[0, 2, 1, 3]]
    assert not any_crossing(np.hstack([chain, np.roll(chain, -1, 0)]))
    assert any_crossing(np.hstack([tie, np.roll(tie, -1, 0)]))
