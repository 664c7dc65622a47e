"""The expert drives every vehicle without collisions and recovers when stuck."""

from __future__ import annotations

import dataclasses
import math
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from shapechanger.contract.world import Pose
from shapechanger.errors import UnknownName
from shapechanger.vehicles.courses.course import HOME
from shapechanger.vehicles.envs import RangesEnv
from shapechanger.vehicles.expert.driver import CourseExpert
from tests.vehicles.expert.courses import ring


def _progress_m(env: RangesEnv, seconds: float) -> float:
    """Let the expert drive for a time, and return the net progress, m."""
    expert, info = env.expert(), dict[str, Any]()
    for _ in range(round(seconds * 20)):
        *_, info = env.step(expert(None))
    return info["progress"]


@pytest.mark.parametrize("name", HOME)
def test_each_vehicle_drives_round_its_world(name: str) -> None:
    """The expert is fast and has no contact; the current of harbours does not push it aside."""
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


def test_an_unknown_vehicle_is_refused() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match="Did you mean 'truck'"):
        CourseExpert(ring(0), "trukc")
