"""Experts: closed lines, planned paths, driving without collisions, and recovery."""

import dataclasses
import itertools
import math
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from shapechanger.contract.world import Pose
from shapechanger.errors import WorldError
from shapechanger.vehicles.courses import lay_out
from shapechanger.vehicles.courses.course import HOME, Course, Obstacle, Wall
from shapechanger.vehicles.courses.geometry import (
    FAR_M,
    ClearanceField,
    ClosedLine,
    CourseProgress,
    length,
    normals,
    resample,
)
from shapechanger.vehicles.envs import RangesEnv
from shapechanger.vehicles.expert.driver import TRAITS, CourseExpert, plan_path_for
from shapechanger.vehicles.expert.path import plan_path


def ring(seed: int, *, radius: float = 8.0, obstacles: int = 10) -> Course:
    """Return a wavy ring, 2 m wide, with boxes and posts on both sides that leave 0.9 m or more."""
    half_width, gap = 1.0, 0.9
    rng = np.random.default_rng(seed)
    turns = np.linspace(0.0, 2 * np.pi, 400, endpoint=False)
    phases = rng.uniform(0, 2 * np.pi, 2)
    far = radius * (1 + 0.12 * np.cos(2 * turns + phases[0]) + 0.08 * np.cos(3 * turns + phases[1]))
    route = np.stack((far * np.cos(turns), far * np.sin(turns)), axis=1)
    route = resample(route, length(route) / 400)
    left = normals(route)
    walls: list[Wall] = []
    for side in (1, -1):
        edge = (route + side * half_width * left)[::4][::-side]
        ends = zip(edge, np.roll(edge, -1, axis=0), strict=True)
        walls += [Wall.between(start, end, 0.5, "plaster") for start, end in ends]
    stand: list[Obstacle] = []
    for n in range(obstacles):
        i = int((n + rng.uniform(0.2, 0.8)) * len(route) / obstacles)
        size = float(rng.uniform(0.25, 0.5))
        reach = float(rng.uniform(0.3, 2 * half_width - gap - 0.1))
        side = rng.choice((-1, 1))
        x, y = route[i] + side * (half_width - reach + size / 2) * left[i]
        yaw = float(np.arctan2(-left[i, 0], left[i, 1]))
        kind = "box" if rng.random() < 0.5 else "post"
        stand.append(Obstacle(kind, float(x), float(y), yaw, size, size, 0.4))
    return Course(
        world="corridor",
        seed=seed,
        route=route,
        half_width=np.full(len(route), half_width),
        walls=tuple(walls),
        obstacles=tuple(stand),
        lamps=(),
        ceiling_m=0.0,
        gap_m=gap,
    )


_SQUARE = ClosedLine(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]))
_RING = ClosedLine(ring(0).route)


def test_signed_distances_of_a_square() -> None:
    """Distances are positive on the left, the inside of a counter-clockwise line."""
    assert _SQUARE.length == 16.0
    assert _SQUARE.nearest(1.0, 0.5) == pytest.approx((1.0, 0.5))
    assert _SQUARE.nearest(1.0, -0.5) == pytest.approx((1.0, -0.5))
    assert _SQUARE.nearest(-0.5, 1.0) == pytest.approx((15.0, -0.5))


@given(station=st.floats(-200.0, 200.0))
def test_nearest_inverts_at(station: float) -> None:
    """`nearest` finds the station of a point that `at` returned, up to whole laps."""
    x, y = _RING.at(station)
    spot = _RING.nearest(x, y)
    assert abs(_RING.ahead_by(station, spot.station)) < 1e-6
    assert abs(spot.lateral) < 1e-6


def test_a_hint_selects_a_part_of_the_line() -> None:
    """With a hint, a nearer parallel part far along the line is ignored."""
    there = [(x, 0.0) for x in np.arange(0.0, 20.0, 0.1)]
    back = [(x, 1.0) for x in np.arange(20.0, 0.0, -0.1)]
    line = ClosedLine(np.array(there + back))
    assert line.nearest(10.0, 0.9).station > 20
    assert line.nearest(10.0, 0.9, hint=9.8).station == pytest.approx(10.0)


def test_progress_is_the_net_distance() -> None:
    """Progress adds whole laps, and subtracts backward motion."""
    course = ring(0)
    line = ClosedLine(course.route)
    progress = CourseProgress(course)
    progress.reset(*line.at(5.0))
    metres = 0.0
    for station in np.arange(5.0, 5.0 + 3 * line.length, 0.1):
        metres = progress.update(*line.at(float(station)))
    assert metres == pytest.approx(3 * line.length, abs=0.2)
    for station in np.arange(5.0 + 3 * line.length, 4.0, -0.1):
        metres = progress.update(*line.at(float(station)))
    assert metres == pytest.approx(-1.0, abs=0.2)


@pytest.mark.parametrize("vehicle", HOME)
@pytest.mark.parametrize("seed", range(3))
def test_properties_of_a_path(vehicle: str, seed: int) -> None:
    """A path is closed, evenly spaced, goes around the lane once, and keeps its clearance."""
    course, traits = lay_out(HOME[vehicle], seed), TRAITS[vehicle]
    path = plan_path(course, traits.half_width_m, traits.margin_m, comfort_m=traits.comfort_m)
    least = traits.half_width_m + traits.margin_m
    steps = np.roll(path.points, -1, axis=0) - path.points
    sizes = np.hypot(steps[:, 0], steps[:, 1])
    np.testing.assert_allclose(sizes, 0.1, rtol=0.05)
    assert (np.diff(path.stations) > 0).all()
    turns = np.angle(np.exp(1j * (np.arctan2(steps[:, 1], steps[:, 0]) - path.heading)))
    np.testing.assert_allclose(turns, path.curvature * 0.05, atol=0.05)
    # Between two points, the clearance is lower by at most half of their distance.
    between = (path.points + steps / 2).reshape(-1, 2)
    obstacles = ClearanceField(course)
    assert obstacles.distance(path.points).min() >= least
    assert obstacles.distance(between).min() >= least - 0.01
    lane = ClosedLine(course.route)
    places = [lane.nearest(x, y) for x, y in path.points]
    gains = [
        lane.ahead_by(a.station, b.station) for a, b in itertools.pairwise([*places, places[0]])
    ]
    assert sum(gains) == pytest.approx(lane.length)  # Exactly one lap forward.
    assert min(gains) > -0.05


def _plug(course: Course, size: float) -> Course:
    x, y = course.route[100]
    ahead = course.route[101] - course.route[99]
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    obstacle = Obstacle("box", float(x), float(y), yaw, 0.3, size, 0.4)
    return dataclasses.replace(course, obstacles=(*course.obstacles, obstacle))


def test_a_gap_is_found_until_it_is_too_narrow() -> None:
    """A passage of 0.6 m fits a width of 0.5 m, not one of 0.7 m; the error names the width."""
    course = _plug(ring(0, obstacles=0), 0.8)
    assert plan_path(course, 0.1, 0.15, comfort_m=0.45).clearance.min() >= 0.25
    with pytest.raises(WorldError, match=r"blocked for anything 0\.70 m wide .* another seed"):
        plan_path(course, 0.1, 0.25, comfort_m=0.75)


@pytest.mark.parametrize("seed", [480, 889, 1_000_074])
def test_a_boat_passes_narrow_flooded_corridors(seed: int) -> None:
    """If no path has the whole margin of the boat, a path with two thirds of it is planned."""
    course, boat = lay_out("flooded-corridor", seed), TRAITS["boat"]
    with pytest.raises(WorldError):
        plan_path(course, boat.half_width_m, boat.margin_m, comfort_m=boat.comfort_m)
    path = plan_path_for(course, boat)
    assert path.clearance.min() >= boat.half_width_m + boat.margin_m * 2.0 / 3.0


def test_distances_are_exact() -> None:
    box = Obstacle("box", 1.0, 1.0, np.pi / 4, 0.4, 0.2, 0.3)
    post = Obstacle("post", 3.0, 0.0, 0.0, 0.4, 0.4, 0.3)
    empty = ring(0, obstacles=0, radius=50.0)
    obstacles = ClearanceField(dataclasses.replace(empty, walls=(), obstacles=(box, post)))
    far = np.sqrt(0.5)
    points = np.array([(1.0, 1.0), (1.0 + far, 1.0 + far), (1.0 - far, 1.0 + far), (3.0, 1.0)])
    np.testing.assert_allclose(obstacles.distance(points), [0.0, 0.8, 0.9, 0.8])
    assert obstacles.distance(np.array([(30.0, 0.0)])) == FAR_M
    assert obstacles.distance(np.empty((0, 2))).shape == (0,)
    # Walls are line segments.
    walls = ClearanceField(dataclasses.replace(empty, obstacles=()))
    wall = empty.walls[0]
    middle = (np.array(wall.start) + np.array(wall.end)) / 2
    assert walls.distance(middle[None])[0] == pytest.approx(0.0, abs=1e-9)


def _progress_m(env: RangesEnv, seconds: float) -> float:
    expert, info = env.expert(), dict[str, Any]()
    for _ in range(round(seconds * 20)):
        *_, info = env.step(expert(None))
    return info["progress"]


@pytest.mark.parametrize("name", HOME)
def test_the_expert_drives_each_vehicle(name: str) -> None:
    """The expert is fast and has no contact, also in the current of a harbour."""
    with closing(RangesEnv(name)) as env:
        env.reset(options={"course": 1, "start": 1})
        metres = _progress_m(env, 20.0)
        world = env.world
        assert metres > 0.7 * 20.0 * world.vehicle.top_speed_mps
        assert world.collisions == 0
        assert abs(world.path().nearest(world.pose.x, world.pose.y).lateral) < 0.35


@pytest.mark.parametrize("name", HOME)
@pytest.mark.parametrize("side", [1, -1])
def test_a_vehicle_recovers_from_a_wall(name: str, side: int) -> None:
    """A vehicle that faces a wall backs up, turns and drives on."""
    with closing(RangesEnv(name, put_back=True)) as env:
        env.reset(options={"course": 7, "start": 7})
        x, y, heading = dataclasses.astuple(env.world.pose)
        heading += side * math.pi / 2
        env.world.put(Pose(x, y, heading))
        near = float(env.world.ranges_m(np.zeros(1))[0]) - 0.1
        env.world.put(Pose(x + near * math.cos(heading), y + near * math.sin(heading), heading))
        assert _progress_m(env, 20.0) > 0.4 * 20.0 * env.world.vehicle.top_speed_mps


def test_the_expert_backs_up_when_it_is_stuck() -> None:
    """Recovery starts after 0.7 s of throttle without motion, and depends on the seed."""

    def actions(seed: int) -> NDArray[np.float32]:
        expert = CourseExpert(ring(1), "car", seed)
        (x, y), heading = expert.path.points[0].tolist(), float(expert.path.heading[0])
        return np.array([expert.act(Pose(x, y, heading), 0.0) for _ in range(120)])

    throttles = actions(0)[:, 1]
    first_back = int((throttles < 0.0).argmax())
    assert 13 <= first_back <= 15
    assert throttles[:first_back].min() > 0.25
    assert throttles[first_back + 10 :].max() > 0.25
    np.testing.assert_array_equal(actions(0), actions(0))
    assert (actions(0) != actions(1)).any()
