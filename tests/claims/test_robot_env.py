"""`RemoteVehicle-v1` through connection, daemon, guard and drivers to a twin."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.errors import LinkError
from shapechanger.robot.drivers.simulation import WiredOutput
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from shapechanger.robot.twin.wiring import TwinWiring
from shapechanger.vehicles.remote.discrete_driving import FOUR_WAYS, DiscreteDriving
from tests.robot.profile.texts import HOVERCRAFT
from tests.robot.twin.robots import until
from tests.robots import BLIND_CAR, IN_A_ROOM, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

Env = gym.Env[Any, Any]
FORWARD = np.array([0.0, 1.0], np.float32)
STILL = np.zeros(2, np.float32)


def env_of(robot: RunningRobot, **options: Any) -> Env:
    """Make the env of a robot, in lockstep."""
    known = robot.known
    access = {"robot": known.address, "key": known.key, "fingerprint": known.fingerprint}
    options = {"pace": "lockstep"} | options
    return gym.make("shapechanger/RemoteVehicle-v1", **access, **options)


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningRobot]:
    """The car with all sensors, on the twin's clock."""
    with run_robot(
        write_profile(tmp_path_factory.mktemp("car")), clock="twin", arguments=IN_A_ROOM
    ) as robot:
        yield robot


@pytest.fixture
def serve() -> Iterator[Callable[[Profile], RunningRobot]]:
    """Serve a robot on the twin's clock until the end of the test."""
    with ExitStack() as stack:
        yield lambda profile: stack.enter_context(
            run_robot(profile, clock="twin", arguments=IN_A_ROOM)
        )


@pytest.fixture
def env(car: RunningRobot) -> Iterator[Env]:
    """The env of the car at its start."""
    with car.operator() as operator:
        operator.place(0)
    made = env_of(car)
    yield made
    made.close()


def test_the_reward_is_the_distance_by_the_encoder(car: RunningRobot, env: Env) -> None:
    """`info` names the sensors, and the distance agrees with the twin."""
    seen, info = env.reset(seed=0)
    assert seen.shape == (120, 160, 3)
    assert seen.dtype == np.uint8
    with car.operator() as operator:
        start = operator.where().travelled_m
        metres = 0.0
        for _ in range(20):
            seen, reward, terminated, truncated, info = env.step(FORWARD)
            assert not terminated
            assert not truncated, info["truncated_because"]
            assert reward == pytest.approx(sum(info["reward_terms"].values()))
            assert info["reward_terms"]["reward_collision"] == 0.0
            metres += info["reward_velocity"]
        travelled = operator.where().travelled_m - start
    assert info["reward_sources"] == {"speed": "wheel", "collision": "bumper", "stall": "wheel"}
    assert metres == pytest.approx(travelled, rel=0.2)
    assert metres > 0.4
    assert info["action_applied"].tolist() == [0.0, 1.0]
    assert info["frame_age"] >= 0.0


def test_a_wall_ends_the_episode(env: Env) -> None:
    """The episode terminates with the collision term, and the next one starts."""
    env.reset(seed=0)
    for _ in range(200):
        _, reward, terminated, truncated, info = env.step(FORWARD)
        assert not truncated, info["truncated_because"]
        if terminated:
            break
    else:
        pytest.fail("The car did not reach a wall.")
    assert info["reward_collision"] == -10.0
    assert float(reward) < -9.0
    env.reset(seed=1)
    *_, terminated, truncated, _ = env.step(-FORWARD)
    assert not terminated
    assert not truncated


def test_the_size_of_2017(car: RunningRobot) -> None:
    """Images of 128 x 128, with the state."""
    env = env_of(car, size=(128, 128), state=True)
    seen, _ = env.reset(seed=0)
    assert env.observation_space.contains(seen)
    assert seen["image"].shape == (128, 128, 3)
    env.close()


def test_four_keys(car: RunningRobot) -> None:
    """Forward and backward drive, right and left steer."""
    with car.operator() as operator:
        operator.place(0)
    env = DiscreteDriving(env_of(car))
    env.reset(seed=0)
    wanted = {"forward": (0, 1), "backward": (0, -1), "right": (1, 0), "left": (-1, 0)}
    info: dict[str, Any] = {}
    for number, way in enumerate(FOUR_WAYS):
        for _ in range(20):  # An earlier bump may still have an effect.
            *_, info = env.step(np.int64(number))
            if tuple(info["action_applied"]) == wanted[way]:
                break
        assert tuple(info["action_applied"]) == wanted[way]
    env.close()


def test_a_lost_link_truncates(tmp_path: Path, serve: Callable[[Profile], RunningRobot]) -> None:
    """The info gives the reason, and the next reset raises an error that names the checks."""
    robot = serve(write_profile(tmp_path))
    env = env_of(robot, reset_timeout_s=1.0)
    env.reset(seed=0)
    env.step(FORWARD)
    robot.supervisor.kill()
    robot.supervisor.wait()
    info: dict[str, Any] = {}
    for _ in range(100):
        *_, terminated, truncated, info = env.step(FORWARD)
        assert not terminated
        # The guard may first report that it disarmed.
        if truncated and not info["truncated_because"].startswith("The robot was disarmed"):
            break
    # On a twin, the daemon may first report the loss of the board.
    lost = ("The link to the robot is lost", "The twin's board is gone")
    assert info["truncated_because"].startswith(lost)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(FORWARD)
    with pytest.raises(LinkError, match="No robot answers"):
        env.reset()
    env.close()


def test_without_sensors_the_reward_is_absent(
    tmp_path: Path, serve: Callable[[Profile], RunningRobot]
) -> None:
    """No term is estimated."""
    env = env_of(serve(write_profile(tmp_path, BLIND_CAR)))
    env.reset(seed=0)
    *_, reward, terminated, _, info = env.step(FORWARD)
    assert info["reward_sources"] == dict.fromkeys(("speed", "collision", "stall"), "absent")
    assert info["reward_terms"] == {}
    assert reward == 0.0
    assert not terminated
    env.close()


@pytest.mark.parametrize(("name", "actions"), [("cat", 12), ("finger-pwm", 7)])
def test_bodies_that_do_not_drive(
    serve: Callable[[Profile], RunningRobot], name: str, actions: int
) -> None:
    """The same env class moves legs and tendons, each to its command."""
    profile = load_profile(find_profile(name))
    wiring = TwinWiring(profile.guard_plan(), None)
    robot = serve(profile)
    env = env_of(robot)
    env.reset(seed=0)
    assert env.action_space.shape == (actions,)
    # Different values, within all caps.
    action = np.linspace(0.2, 0.6, actions, dtype=np.float32)
    assert env.action_space.contains(action)
    info: dict[str, Any] = {}
    for _ in range(100):
        *_, truncated, info = env.step(action)
        assert not truncated, info["truncated_because"]
    applied = dict(zip((a.name for a in profile.actions), info["action_applied"], strict=True))
    assert len(set(applied.values())) > 1
    with robot.operator() as operator:
        outputs = wiring.read(operator.levels(), operator.where().t)
    for output in profile.outputs:
        mixed = output.offset + sum(w * applied[n] for n, w in output.mix.items())
        assert outputs[output.name].value == pytest.approx(np.clip(mixed, -1, 1), abs=0.02)
    env.close()


def test_a_vehicle_defined_by_its_profile_alone(
    tmp_path: Path, serve: Callable[[Profile], RunningRobot]
) -> None:
    """The fans and rudders of a hovercraft follow their commands."""
    profile = write_profile(tmp_path, HOVERCRAFT)
    wiring = TwinWiring(profile.guard_plan(), None)
    robot = serve(profile)
    env = env_of(robot)
    env.reset(seed=0)
    with robot.operator() as operator:

        def outputs() -> dict[str, WiredOutput]:
            return wiring.read(operator.levels(), operator.where().t)

        start = operator.where()
        for _ in range(80):  # The fan's controller first needs neutral.
            *_, truncated, info = env.step(np.array([0.5, 0.8, 0.6], np.float32))
            assert not truncated, info["truncated_because"]
        values = {name: output.value for name, output in outputs().items()}
        wanted = {"fan": 0.8, "lift_fan": 0.6, "left_rudder": 0.5, "right_rudder": 0.4}
        assert values == pytest.approx(wanted, abs=0.02)
        after = operator.where()
        assert after.travelled_m > start.travelled_m
        assert after.heading < start.heading
        env.close()

        def rests() -> bool:
            operator.advance(0.05)
            return all(outputs()[name].at_rest for name in wiring.propelling)

        until(rests)
