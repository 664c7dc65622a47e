"""The env of a vehicle compared with a whole simulated robot: guard, drivers and chips."""

import math
from collections.abc import Callable
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shapechanger.layout import Layout
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.vehicles.courses.course import HOME
from shapechanger.vehicles.envs import VehicleEnv
from shapechanger.vehicles.world import MujocoWorld
from tests.robot.twin.in_process import InProcessRobot

_COURSE, _START = 5, 3


def _side_by_side(
    env: VehicleEnv, act: Callable[[Any], NDArray[np.float32]], metres: float, steps: int
) -> dict[str, float]:
    """Drive the env and a whole robot with the same actions; return the largest differences."""
    vehicle = env.world.vehicle.name
    profile = load_profile(find_profile(f"lab-{vehicle}"))
    far = {"place": 0.0}
    with (
        closing(MujocoWorld(vehicle, seed=_COURSE, size=None)) as world,
        closing(InProcessRobot(profile, world, pictures=False)) as robot,
    ):
        names = Layout.from_json(robot.welcome.state_layout).names
        assert names == env.observation_layout.names
        seen, info = env.reset(options={"course": _COURSE, "start": _START})
        world.zero_odometer()
        robot.start(lambda: world.place(_START))
        while steps and info["progress"] < metres:
            steps -= 1
            action, before = act(seen), world.collisions
            seen, _, _, _, info = env.step(action)
            there, _ = robot.step(tuple(float(value) for value in action))
            assert info["stop_reason"] == there.stop_reason
            for name, ours, theirs in zip(names, seen, there.state, strict=True):
                far[name] = max(far.get(name, 0.0), abs(float(ours) - theirs))
            if world.collisions > before:
                world.put_back()
            assert info["collisions"] == world.collisions
            here, other = env.world.pose, world.pose
            far["place"] = max(far["place"], math.hypot(here.x - other.x, here.y - other.y))
        far["collisions"] = world.collisions
    return far


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", HOME)
def test_positions_agree_with_the_whole_robot_over_100_m(vehicle: str) -> None:
    """Positions agree within 2 cm, and collisions are equal."""
    with closing(VehicleEnv(vehicle, image=False, put_back=True)) as env:
        assert _side_by_side(env, env.expert(), 100.0, 6000)["place"] < 0.02
        assert env.world.progress_m >= 100.0


@pytest.mark.parametrize("vehicle", HOME)
def test_sensors_and_reflexes_agree_with_the_whole_robot(vehicle: str) -> None:
    """Readings and reasons of stops agree while a vehicle drives into walls and back."""
    ways = np.array([(-0.6, 0.8), (0.9, 0.7), (0.3, -0.6)], np.float32)
    drawn = iter(np.repeat(np.tile(ways, (4, 1)), 20, axis=0))
    with closing(VehicleEnv(vehicle, image=False, put_back=True)) as env:
        far = _side_by_side(env, lambda _: next(drawn), 100.0, 160)
    assert far.pop("collisions") >= (0 if vehicle == "boat" else 1)
    assert far.pop("battery") < 0.5  # Volts; the two are read at different times.
    assert far.pop("place") < 1e-6
    assert all(difference < 0.03 for difference in far.values()), far
