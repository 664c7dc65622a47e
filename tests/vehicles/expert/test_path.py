"""Planned paths are closed, clear and smooth; impossible ones raise errors."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from shapechanger.errors import WorldError
from shapechanger.vehicles.courses import lay_out
from shapechanger.vehicles.courses.course import Course, Obstacle
from shapechanger.vehicles.courses.geometry import FAR_M, ClearanceField, ClosedLine
from shapechanger.vehicles.expert.driver import TRAITS, plan_path_for
from shapechanger.vehicles.expert.path import CoursePath, plan_path
from tests.vehicles.expert.courses import ring

_HOMES = {"car": "corridor", "tank": "corridor", "truck": "yard", "boat": "harbour"}
_CASES = list(itertools.product(_HOMES, range(3)))


def _planned(vehicle: str, seed: int) -> tuple[Course, CoursePath, float]:
    """Return a course of the vehicle, its path, and the required clearance."""
    traits = TRAITS[vehicle]
    course = lay_out(_HOMES[vehicle], seed)
    path = plan_path(course, traits.half_width_m, traits.margin_m, comfort_m=traits.comfort_m)
    return course, path, traits.half_width_m + traits.margin_m


@pytest.mark.parametrize(("vehicle", "seed"), _CASES)
def test_properties_of_a_path(vehicle: str, seed: int) -> None:
    """A path is closed, evenly spaced, follows the lane once, and keeps its clearance."""
    course, path, least = _planned(vehicle, seed)
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


@pytest.mark.parametrize("vehicle", _HOMES)
def test_a_path_can_be_driven(vehicle: str) -> None:
    """The curvature is within the vehicle's limit, and the length close to the lane's."""
    for seed in range(3):
        course, path, _ = _planned(vehicle, seed)
        assert np.abs(path.curvature).max() < TRAITS[vehicle].turn
        assert path.length == pytest.approx(course.length, rel=0.12)


def _plug(course: Course, size: float) -> Course:
    """Return the course with a box of this size in the middle of its lane."""
    x, y = course.route[100]
    ahead = course.route[101] - course.route[99]
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    obstacle = Obstacle("box", float(x), float(y), yaw, 0.3, size, 0.4)
    return dataclasses.replace(course, obstacles=(*course.obstacles, obstacle))


def test_a_blocked_lane_is_refused() -> None:
    """The message names the width, the place and alternatives."""
    with pytest.raises(WorldError, match=r"blocked for anything 0\.40 m wide .* another seed"):
        plan_path(_plug(ring(0, obstacles=0), 2.0), 0.1, 0.1, comfort_m=0.3)


def test_a_gap_is_found_until_it_is_too_narrow() -> None:
    """A passage of 0.6 m fits a width of 0.5 m, not one of 0.7 m."""
    course = _plug(ring(0, obstacles=0), 0.8)
    assert plan_path(course, 0.1, 0.15, comfort_m=0.45).clearance.min() >= 0.25
    with pytest.raises(WorldError):
        plan_path(course, 0.1, 0.25, comfort_m=0.75)


@pytest.mark.parametrize("seed", [480, 889, 1_000_074])
def test_a_boat_gets_through_every_flooded_corridor(seed: int) -> None:
    """With two thirds of its clearance if the whole does not fit."""
    course, boat = lay_out("flooded-corridor", seed), TRAITS["boat"]
    with pytest.raises(WorldError):
        plan_path(course, boat.half_width_m, boat.margin_m, comfort_m=boat.comfort_m)
    path = plan_path_for(course, boat)
    assert path.clearance.min() >= boat.half_width_m + boat.margin_m * 2.0 / 3.0


def test_distances_are_exact() -> None:
    """Distances from walls, rotated boxes and cylinders are exact, and 0 inside."""
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
