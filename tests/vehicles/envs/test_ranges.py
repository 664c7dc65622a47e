"""The fast env with distances."""

import math
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, LimitPlan, OutputPlan
from shapechanger.vehicles.courses.course import HOME
from shapechanger.vehicles.envs import RangesEnv, VehicleEnv
from shapechanger.vehicles.envs.ranges import BEARINGS_DEG, FARTHEST_M, MeanOutputs, leave_rest
from shapechanger.vehicles.waypoints import LEAST_THROTTLE

_COURSE = {"course": 2, "start": 2}
_STEPS = 60


@pytest.mark.parametrize("vehicle", HOME)
def test_the_fast_env_matches_the_full_robot(vehicle: str) -> None:
    with closing(VehicleEnv(vehicle, image=False)) as robot, closing(RangesEnv(vehicle)) as fast:
        robot.reset(options=_COURSE)
        fast.reset(options=_COURSE)
        expert = robot.expert()
        info: dict[str, Any] = {}
        other: dict[str, Any] = {}
        for _ in range(_STEPS):
            action = expert(None)
            info = robot.step(action)[-1]
            other = fast.step(action)[-1]
        (x, y, heading), (fast_x, fast_y, fast_heading) = info["pose"], other["pose"]
        assert info["progress"] > 1.0
        assert math.hypot(x - fast_x, y - fast_y) < 0.03 * info["progress"]
        assert abs(math.remainder(heading - fast_heading, math.tau)) < math.radians(3.0)
        assert other["progress"] == pytest.approx(info["progress"], rel=0.02)
        assert other["collisions"] == info["collisions"] == 0


def test_distances_end_at_the_walls() -> None:
    """The distances to the left and right add up to the width of the lane in both directions."""
    with closing(RangesEnv("car")) as env:
        seen, _ = env.reset(options=_COURSE)
        distances = dict(zip(BEARINGS_DEG, seen, strict=False))
        assert distances[0] == pytest.approx(env.world.distance_m(), rel=0.1)
        assert min(distances[90], distances[-90]) > 0.1
        width = distances[90] + distances[-90]
        assert width < FARTHEST_M
        pose = env.world.pose
        env.world.put(type(pose)(pose.x, pose.y, pose.heading + math.pi))
        turned = env.world.ranges_m(np.radians(BEARINGS_DEG))
        assert turned[0] + turned[-1] == pytest.approx(width, rel=0.3)


def test_the_pause_after_a_collision_matches_the_full_robot() -> None:
    """The bumper's reflex stops the vehicle for 0.75 s after `put_back`."""
    ahead = np.array([0.0, 0.8], np.float32)
    waits: list[int] = []
    for env in (VehicleEnv("car", image=False, put_back=True), RangesEnv("car", put_back=True)):
        with closing(env):
            env.reset(options=_COURSE)
            steps = 0
            while env.step(ahead)[-1]["collisions"] == 0:
                steps += 1
                assert steps < 200
            before = env.step(ahead)[-1]["progress"]
            wait = 1
            while env.step(ahead)[-1]["progress"] - before < 0.02:
                wait += 1
                assert wait < 60
            waits.append(wait)
    assert min(waits) >= 14
    assert abs(waits[0] - waits[1]) <= 2


def test_outputs_follow_the_guards_limits() -> None:
    plan = GuardPlan(
        "test",
        (ActionPlan("throttle", high=0.5, slew_per_s=4.0, propels=True),),
        (OutputPlan("drive", "hbridge", "wheels", {"throttle": 1.0}),),
        limits=LimitPlan(bump_hold_ms=100),
    )
    shaper = MeanOutputs(plan)
    # Five ticks of 10 ms, at 0, 0.04, ... 0.16.
    assert shaper.outputs((1.0,), False, 5)["wheels"] == pytest.approx(0.08)
    for _ in range(4):
        last = shaper.outputs((1.0,), False, 5)["wheels"]
    assert last == pytest.approx(0.5)
    blocked = [shaper.outputs((1.0,), bumped, 5)["wheels"] for bumped in (True, False, False)]
    assert blocked[1] == pytest.approx(0.0)
    assert blocked[2] == pytest.approx(0.08)


def test_a_small_throttle_moves_a_vehicle_at_rest() -> None:
    """At rest, the size of a throttle other than 0 is raised to `LEAST_THROTTLE`."""
    for throttle, least_m, most_m in ((0.05, 0.03, 1.0), (-0.05, -1.0, -0.03), (0.0, -0.01, 0.01)):
        with closing(RangesEnv("car")) as env:
            env.reset(options=_COURSE)
            for _ in range(20):
                *_, info = env.step(np.array([1.0, throttle], np.float32))
            assert least_m <= info["progress"] <= most_m, throttle


def test_teachers_demonstrate_the_raised_throttle() -> None:
    """At rest, a teacher's throttle is raised as in the env in which the teacher learned."""
    action = np.array([1.0, -0.02], np.float32)
    with closing(VehicleEnv("car", image=False)) as env:
        env.reset(options=_COURSE)
        driver = env.taught_by(lambda seen: action[np.newaxis], seed=0)
        meant, _ = driver.act()
    assert meant.tolist() == [1.0, -LEAST_THROTTLE]
    assert leave_rest(action, stands=False) is action
