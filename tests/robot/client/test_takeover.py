"""Episodes in which a person takes control and returns it."""

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.profile.load import find_profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot

pytestmark = pytest.mark.realtime

AHEAD = np.array([0.25, 0.5], np.float32)
BACK = (-0.5, -0.4)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    """A car in the plain room, in its own processes."""
    folder = tmp_path_factory.mktemp("robot")
    with run_robot(find_profile("car"), folder=folder, arguments=("--world", "room")) as running:
        yield running


def _made(robot: RunningRobot, **options: Any) -> gym.Env[Any, Any]:
    known = robot.known
    return gym.make(
        "shapechanger/RemoteVehicle-v1",
        robot=known.address,
        key=known.key,
        fingerprint=known.fingerprint,
        name="pupil",
        reward={"collision_ends_episode": 0.0},
        max_episode_steps=10_000,
        **options,
    )


def _step_until(
    env: gym.Env[Any, Any], is_true: Callable[[dict[str, Any]], bool], at_most: int = 100
) -> dict[str, Any]:
    """Step until a condition on the info holds; the episode must not end before."""
    for _ in range(at_most):
        _, _, terminated, truncated, info = env.step(AHEAD)
        assert not terminated
        assert not truncated, info["truncated_because"]
        if is_true(info):
            return info
    pytest.fail(f"The condition did not hold within {at_most} steps.")


def test_a_person_takes_over_and_gives_back(robot: RunningRobot) -> None:
    with _made(robot, interventions=True) as env, robot.client(role="person") as person:
        env.reset()
        info = _step_until(env, lambda info: info["action_applied"][1] > 0.0)
        assert "intervene_action" not in info

        person.take()
        seen = person.ask()
        person.command(BACK, answers=seen.message.seq)
        info = _step_until(env, lambda info: "intervene_action" in info)
        np.testing.assert_allclose(info["intervene_action"], BACK, rtol=1e-6)
        _step_until(env, lambda info: bool(person.ask().message.suggested))
        shown = person.ask().message
        assert shown.suggested == pytest.approx(tuple(AHEAD))
        assert shown.suggested_by == "pupil"
        assert shown.action_applied[1] <= 0.0

        person.release()
        _step_until(env, lambda info: person.ask().message.holder == "pupil")
        person.arm()
        info = _step_until(env, lambda info: info["action_applied"][1] > 0.0)
        assert "intervene_action" not in info


def test_a_person_who_stops_ends_the_episode(robot: RunningRobot) -> None:
    with _made(robot, interventions=True) as env, robot.client(role="person") as person:
        env.reset()
        _step_until(env, lambda info: info["action_applied"][1] > 0.0)
        person.disarm()
        assert "disarmed" in _cut(env)
        person.take()
        person.arm()
        person.release()
        env.reset()
        person.emergency_stop("enough")
        assert "Emergency stop" in _cut(env)
        _end_emergency(person)


def _cut(env: gym.Env[Any, Any]) -> str:
    """Step until the episode is truncated, and return the reason."""
    for _ in range(100):
        _, _, _, truncated, info = env.step(AHEAD)
        if truncated:
            return info["truncated_because"]
    pytest.fail("The episode was not truncated.")


def _end_emergency(person: RobotClient) -> None:
    person.take()
    person.ask()
    person.arm()
    person.release()
