"""Episodes in which a person takes control and returns it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.robot.client.operator import Takeover
from shapechanger.robot.profile.load import find_profile
from shapechanger.robot.twin.robot import run_robot
from tests.robot.client.robot import observation

pytestmark = pytest.mark.realtime

AHEAD = np.array([0.25, 0.5], np.float32)
BACK = (-0.5, -0.4)


def test_a_person_takes_over_and_gives_back(tmp_path: Path) -> None:
    with (
        run_robot(find_profile("car"), folder=tmp_path, arguments=("--world", "room")) as robot,
        gym.make(
            "shapechanger/RemoteVehicle-v1",
            robot=robot.known.address,
            key=robot.known.key,
            fingerprint=robot.known.fingerprint,
            name="pupil",
            reward={"collision_ends_episode": 0.0},
            max_episode_steps=10_000,
            interventions=True,
        ) as env,
        robot.client(role="person") as person,
    ):

        def step_until(is_true: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
            for _ in range(100):
                _, _, terminated, truncated, info = env.step(AHEAD)
                assert (terminated, truncated) == (False, False)
                if is_true(info):
                    return info
            pytest.fail("The condition did not hold within 100 steps.")

        env.reset()
        info = step_until(lambda info: info["action_applied"][1] > 0.0)
        assert "intervene_action" not in info

        person.take()
        person.command(BACK, answers=person.ask().message.seq)
        info = step_until(lambda info: "intervene_action" in info)
        np.testing.assert_allclose(info["intervene_action"], BACK, rtol=1e-6)
        step_until(lambda info: bool(person.ask().message.suggested))
        shown = person.ask().message
        assert shown.suggested == pytest.approx(tuple(AHEAD))
        assert shown.suggested_by == "pupil"
        assert shown.action_applied[1] <= 0.0

        person.release()
        step_until(lambda info: person.ask().message.holder == "pupil")
        person.arm()
        info = step_until(lambda info: info["action_applied"][1] > 0.0)
        assert "intervene_action" not in info


def test_an_emergency_stop_ends_a_takeover() -> None:
    takeover = Takeover(allowed=True)
    assert takeover.goes_on(observation(holder="Ada", holder_role="person"))
    stopped = observation(holder="Ada", holder_role="person", emergency=True)
    assert not takeover.goes_on(stopped)
