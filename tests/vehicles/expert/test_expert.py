"""The expert drives every vehicle without collisions and recovers when stuck."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.contract.world import Pose
from shapechanger.errors import UnknownName
from shapechanger.vehicles.bodies import VEHICLES
from shapechanger.vehicles.courses import lay_out, start_pose
from shapechanger.vehicles.courses.course import Course
from shapechanger.vehicles.envs.demonstrators import Disturbance
from shapechanger.vehicles.expert.driver import CourseExpert
from shapechanger.vehicles.expert.line import CourseProgress
from shapechanger.vehicles.expert.traits import TRAITS
from tests.vehicles.expert.courses import ring
from tests.vehicles.expert.kinematic import SIZES, TOP, Kinematic

_HOMES = {"car": "corridor", "tank": "corridor", "truck": "yard", "boat": "harbour"}


def _drive(
    vehicle: Kinematic,
    expert: CourseExpert,
    course: Course,
    seconds: float,
    disturbance: Disturbance | None = None,
) -> float:
    """Return the net progress after some time, m."""
    progress = CourseProgress(course)
    progress.reset(vehicle.pose.x, vehicle.pose.y)
    for _ in range(round(seconds / 0.05)):
        action = expert.act(vehicle.pose, vehicle.speed, vehicle.yaw_rate)
        assert action.shape == (2,)
        assert action.dtype == np.float32
        assert np.abs(action).max() <= 1.0
        vehicle.advance(disturbance.applied(action) if disturbance else action)
        progress.update(vehicle.pose.x, vehicle.pose.y)
    return progress.update(vehicle.pose.x, vehicle.pose.y)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", _HOMES)
def test_each_vehicle_drives_round_its_world(name: str, seed: int) -> None:
    """The expert is fast and has no contact."""
    course = lay_out(_HOMES[name], seed)
    vehicle = Kinematic(name, course, start_pose(course, seed))
    metres = _drive(vehicle, CourseExpert(course, name), course, 30.0)
    assert vehicle.touches == 0
    assert metres > 0.7 * 30.0 * TOP[name]


@pytest.mark.parametrize("name", _HOMES)
def test_disturbances_are_corrected(name: str) -> None:
    """The expert corrects wandering and jerks with at most one collision."""
    course = lay_out(_HOMES[name], 6)
    vehicle = Kinematic(name, course, start_pose(course, 6))
    expert = CourseExpert(course, name)
    assert (
        _drive(vehicle, expert, course, 40.0, Disturbance(1, TRAITS[name].sway))
        > 0.5 * 40.0 * TOP[name]
    )
    assert vehicle.touches <= 1


def test_a_boat_compensates_for_the_current() -> None:
    """A current of a fifth of its speed displaces it by less than 0.35 m."""
    course = ring(2, half_width=2.5, radius=10.0, gap=1.8, current=(0.2, -0.1))
    x, y = course.route[0]
    ahead = course.route[1] - course.route[0]
    vehicle = Kinematic("boat", course, Pose(x, y, math.atan2(ahead[1], ahead[0])))
    expert = CourseExpert(course, "boat")
    _drive(vehicle, expert, course, 20.0)
    worst = 0.0
    for _ in range(40):
        _drive(vehicle, expert, course, 1.0)
        worst = max(worst, abs(expert.path.nearest(vehicle.pose.x, vehicle.pose.y).lateral))
    assert worst < 0.35
    assert vehicle.touches == 0


@pytest.mark.parametrize("name", _HOMES)
@pytest.mark.parametrize("side", [1, -1])
def test_a_vehicle_recovers_from_a_wall(name: str, side: int) -> None:
    """A vehicle that faces a wall backs up, turns and drives on."""
    half_width = 1.2 if name in ("car", "tank") else 2.5
    course = ring(7, half_width=half_width, radius=10.0, obstacles=0)
    ahead = course.route[31] - course.route[30]
    heading = math.atan2(ahead[1], ahead[0]) + side * math.pi / 2
    near = half_width - SIZES[name][0] / 2 - 0.1
    x, y = course.route[30] + near * np.array((math.cos(heading), math.sin(heading)))
    vehicle = Kinematic(name, course, Pose(float(x), float(y), heading))
    assert _drive(vehicle, CourseExpert(course, name), course, 30.0) > 0.4 * 30.0 * TOP[name]


def pose_on(expert: CourseExpert, i: int) -> Pose:
    """Return the pose at a point of the expert's path."""
    x, y = expert.path.points[i].tolist()
    return Pose(x, y, float(expert.path.heading[i]))


def test_it_backs_up_when_stuck() -> None:
    """Recovery starts after 0.7 s of throttle without motion and ends by driving forward."""
    course = ring(0)
    expert = CourseExpert(course, "car")
    pose = pose_on(expert, 0)
    throttles = [float(expert.act(pose, 0.0)[1]) for _ in range(80)]
    assert min(throttles[:14]) > 0.25
    assert throttles[16] < 0
    first_back = next(i for i, throttle in enumerate(throttles) if throttle < 0)
    assert 13 <= first_back <= 15
    assert max(throttles[first_back + 10 :]) > 0.25


def test_recovery_is_reproducible() -> None:
    """Equal seeds give equal actions during recovery, and another seed differs."""
    course = ring(1)

    def track(seed: int) -> list[float]:
        expert = CourseExpert(course, "car", seed)
        pose = pose_on(expert, 0)
        return [float(value) for _ in range(120) for value in expert.act(pose, 0.0)]

    assert track(0) == track(0)
    assert track(0) != track(1)


def test_a_reset_clears_the_state() -> None:
    """After `reset`, the first actions of an episode repeat."""
    course = ring(1)
    expert = CourseExpert(course, "boat")
    pose = pose_on(expert, 50)
    expert.reset(pose)
    first = [expert.act(pose, 0.5, 0.1) for _ in range(5)]
    for _ in range(40):
        expert.act(Pose(pose.x + 0.3, pose.y, 0.0), 0.0)
    expert.reset(pose)
    np.testing.assert_array_equal(first, [expert.act(pose, 0.5, 0.1) for _ in range(5)])


def test_an_unknown_vehicle_is_refused() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match="Did you mean 'truck'"):
        CourseExpert(ring(0), "trukc")


@pytest.mark.parametrize("name", ["car", "truck"])
def test_steering_matches_the_model(name: str) -> None:
    """The curvature at full lock agrees with the turning radius of the model."""
    model, traits = VEHICLES[name], TRAITS[name]
    assert traits.body is model
    assert 1 / traits.turn == pytest.approx(model.turning_radius_m, rel=0.1)


def test_disturbances_are_reproducible_and_bounded() -> None:
    """The given action is not changed, and the result stays within -1 to 1."""
    action = np.array((0.2, 0.8), np.float32)

    def run(seed: int) -> np.ndarray:
        disturbance = Disturbance(seed, 0.25)
        return np.array([disturbance.applied(action) for _ in range(2000)])

    first = run(3)
    np.testing.assert_array_equal(first, run(3))
    assert (first != run(4)).any()
    assert action.tolist() == pytest.approx([0.2, 0.8])
    assert np.abs(first).max() <= 1.0
    assert first.dtype == np.float32
    assert first[:, 0].mean() == pytest.approx(0.2, abs=0.1)
    assert (first.std(axis=0) > 0.02).all()
