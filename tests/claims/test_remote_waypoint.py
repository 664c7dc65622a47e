"""`RemoteWaypoint-v1` through link, daemon, guard and drivers to a simulated car."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.errors import RobotRefused
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from shapechanger.vehicles.envs import WaypointEnv
from tests.robots import BLIND_CAR, IN_A_ROOM, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

Serve = Callable[..., RunningRobot]
AHEAD = np.zeros(2, np.float32)


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Serve a robot on the twin's clock; it ends with the test."""
    with ExitStack() as stack:
        yield lambda profile, *arguments: stack.enter_context(
            run_robot(profile, clock="twin", arguments=arguments or IN_A_ROOM)
        )


def _env_of(robot: RunningRobot, **options: Any) -> gym.Env[Any, Any]:
    known = robot.known
    access = {"robot": known.address, "key": known.key, "fingerprint": known.fingerprint}
    return gym.make("shapechanger/RemoteWaypoint-v1", pace="lockstep", **access, **options)


def _lab_car() -> Profile:
    return load_profile(find_profile("lab-car"))


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_a_robot_measures_how_it_turns_and_follows_waypoints(serve: Serve, tmp_path: Path) -> None:
    """The measured response is near the simulated car's, and the spaces equal `CarWaypoint`'s."""
    with closing(WaypointEnv("car")) as simulated:
        expected = simulated.response
        stated = find_profile("lab-car").read_text(encoding="utf-8")
        silent = tmp_path / "lab-car.toml"
        silent.write_text(stated.replace("turn_deg_per_m", "# turn_deg_per_m"), encoding="utf-8")
        robot = serve(load_profile(silent), "--seed", "3")
        with closing(_env_of(robot)) as env, robot.operator() as operator:
            env.reset(seed=0)
            response = env.unwrapped.response  # pyright: ignore[reportAttributeAccessIssue]
            found = response.per_metre + response.per_second
            assert found == pytest.approx(expected.per_metre + expected.per_second, rel=0.2)
            assert env.observation_space == simulated.observation_space
            assert env.action_space == simulated.action_space
            operator.place(0)  # The measurement drove the robot away from its start.
            seen, _ = env.reset(seed=0)
            assert env.observation_space.contains(seen)
            rewards = [env.step(AHEAD)[1] for _ in range(40)]  # The bump reflex ends after 0.75 s.
            assert sum(rewards) > 0.05


def test_a_profile_may_state_how_the_robot_turns(serve: Serve) -> None:
    """The shipped profile states the simulated car's response, so the robot does not measure it."""
    stated = _lab_car().turning
    assert stated is not None
    with closing(WaypointEnv("car")) as simulated:
        expected = simulated.response
    assert sum(stated) == pytest.approx(expected.per_metre + expected.per_second, rel=0.05)
    with closing(_env_of(serve(_lab_car(), "--world", "room"))) as env:
        response = env.unwrapped.response  # pyright: ignore[reportAttributeAccessIssue]
        assert (response.per_metre, response.per_second) == stated


def test_a_robot_without_a_measured_camera_is_refused(serve: Serve, tmp_path: Any) -> None:
    """A robot without a camera, or whose camera was not measured, is refused in a sentence."""
    blind = write_profile(tmp_path, BLIND_CAR)
    with pytest.raises(RobotRefused, match="has no camera"):
        _env_of(serve(blind))
    unmeasured = write_profile(tmp_path)
    with pytest.raises(RobotRefused, match="does not state pitch_deg and fovy_deg"):
        _env_of(serve(unmeasured))
