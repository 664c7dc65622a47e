"""`RemoteVehicle-v1` through connection, daemon, guard and drivers to a twin."""

from contextlib import closing
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.robots import IN_A_ROOM, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]


def env_of(robot: RunningRobot) -> gym.Env[Any, Any]:
    known = robot.known
    access = {"robot": known.address, "key": known.key, "fingerprint": known.fingerprint}
    return gym.make("shapechanger/RemoteVehicle-v1", pace="lockstep", **access)


def test_the_reward_is_the_distance_by_the_encoder(tmp_path: Path) -> None:
    """The summed reward agrees with the distance on the twin, and `info` names the sensors."""
    profile = write_profile(tmp_path)
    with (
        run_robot(profile, clock="twin", arguments=IN_A_ROOM) as robot,
        closing(env_of(robot)) as env,
        robot.operator() as operator,
    ):
        env.reset(seed=0)
        start = operator.where().travelled_m
        metres = 0.0
        for _ in range(20):
            _, reward, terminated, truncated, info = env.step(np.array([0.0, 1.0], np.float32))
            assert not terminated
            assert not truncated, info["truncated_because"]
            assert reward == pytest.approx(sum(info["reward_terms"].values()))
            metres += info["reward_velocity"]
        travelled = operator.where().travelled_m - start
        assert info["reward_sources"] == {"speed": "wheel", "collision": "bumper", "stall": "wheel"}
        assert metres == pytest.approx(travelled, rel=0.2)
        assert metres > 0.4
        assert info["action_applied"].tolist() == [0.0, 1.0]


@pytest.mark.parametrize(("name", "actions"), [("cat", 12), ("finger-pwm", 7)])
def test_bodies_that_do_not_drive(name: str, actions: int) -> None:
    """`RemoteVehicle-v1` also moves legs and tendons, each to its command."""
    profile = load_profile(find_profile(name))
    with (
        run_robot(profile, clock="twin", arguments=IN_A_ROOM) as robot,
        closing(env_of(robot)) as env,
        robot.operator() as operator,
    ):
        env.reset(seed=0)
        assert env.action_space.shape == (actions,)
        # Each action gets a different value within its cap.
        action = np.linspace(0.2, 0.6, actions, dtype=np.float32)
        for _ in range(100):
            *_, truncated, info = env.step(action)
            assert not truncated, info["truncated_because"]
        wiring = TwinWiring(profile.guard_plan(), None)
        outputs = wiring.read(operator.levels(), operator.where().t)
    applied = dict(zip((a.name for a in profile.actions), info["action_applied"], strict=True))
    assert len(set(applied.values())) > 1
    for output in profile.outputs:
        mixed = output.offset + sum(w * applied[n] for n, w in output.mix.items())
        assert outputs[output.name].value == pytest.approx(np.clip(mixed, -1, 1), abs=0.02)
