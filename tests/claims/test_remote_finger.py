"""Envs of a finger on a rig, through connection, daemon, guard and drivers to a simulation."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.errors import FingerError, PathError
from shapechanger.finger.gap import resolve_gap
from shapechanger.finger.identify.result import PATH_DELAY_ERROR_S
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.paths import as_path
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from shapechanger.robot.profile.load import find_profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot

Env = gym.Env[Any, Any]

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


@pytest.fixture(scope="module")
def rig() -> Iterator[RunningRobot]:
    """The shipped rig on the twin's clock."""
    with run_robot(find_profile("finger"), clock="twin") as robot:
        yield robot


def _access(robot: RunningRobot) -> dict[str, Any]:
    known = robot.known
    access = {"robot": known.address, "key": known.key, "fingerprint": known.fingerprint}
    return access | {"twin_folder": str(robot.folder)}


def _env(robot: RunningRobot, **options: Any) -> Env:
    return gym.make("shapechanger/RemoteFinger-v1", **_access(robot), **options)


@pytest.fixture
def env(rig: RunningRobot) -> Iterator[Env]:
    made = _env(rig)
    yield made
    made.close()


def _script(env: Env) -> dict[str, Any]:
    """Run a script written for `Finger-v1`, which holds the finger at its start."""
    unwrapped: Any = env.unwrapped
    names = unwrapped.observation_layout.names
    observation, info = env.reset(seed=4)
    commands = [names.index(n) for n in names if n.endswith("/command")]
    total, truncated = 0.0, False
    while not truncated:
        action = np.asarray(observation)[commands].astype(np.float32)
        observation, reward, _, truncated, info = env.step(action)
        total += float(reward)
    return {"target": info["target"], "total": total, "last": observation, "info": info}


def test_one_script_runs_on_both_ids(rig: RunningRobot, env: Env) -> None:
    """Layouts, spaces and target are equal, and the return is similar."""
    with gym.make("shapechanger/Finger-v1") as simulated:
        there, here = _script(env), _script(simulated)
        ours: Any = env.unwrapped
        theirs: Any = simulated.unwrapped
        assert ours.observation_layout == theirs.observation_layout
        assert ours.action_layout == theirs.action_layout
        assert env.observation_space == simulated.observation_space
        assert env.action_space == simulated.action_space
    np.testing.assert_array_equal(there["target"], here["target"])
    assert there["last"].shape == here["last"].shape
    assert there["info"]["truncated_because"] == ""
    assert there["total"] == pytest.approx(here["total"], rel=0.6)
    assert set(here["info"]) <= set(there["info"])


def test_sensed_values_are_near_the_truth(env: Env) -> None:
    """Angles agree within a count, and the fingertip within a fraction of a millimetre."""
    env.reset(seed=1)
    pull = np.array([0.5, 0.5, -0.5, -0.5, 0.0, 0.0, 0.0], np.float32)
    info: dict[str, Any] = {}
    observation: Any = None
    for _ in range(60):
        observation, *_, info = env.step(pull)
    np.testing.assert_allclose(observation[:4], info["true_angles"], atol=0.001)
    assert observation[0] > 0.6  # The finger is bent.
    assert info["distance"] == pytest.approx(info["true_distance"], abs=0.0002)


def test_an_env_with_its_own_twin_is_rewarded_by_the_truth() -> None:
    """Observations are measured, the reward uses true values, and the twin ends with the env."""
    env = gym.make("shapechanger/RemoteFinger-v1", twin="real-like", finger_seed=1)
    own: Any = env.unwrapped
    supervisor = own._own.supervisor
    observation, info = env.reset(seed=0)
    off: list[float] = []
    for _ in range(20):
        observation, _, _, _, info = env.step(env.action_space.sample())
        assert info["distance"] == pytest.approx(info["true_distance"], abs=1e-6)
        off.append(float(np.abs(observation[:4] - info["true_angles"]).max()))
    assert 0.002 < np.median(off) < 0.1  # Encoder noise of about a degree.
    # A reset lets the servos cool down.
    own._operator.break_servo("EDC", "hot")
    _, info = env.reset(seed=1)
    assert info["armed"]
    env.close()
    env.close()
    assert supervisor.poll() is not None


def test_ten_seconds_identify_the_finger() -> None:
    """Identified arms above 2 mm are off by less than 5 %, a nominal arm by more than 15 %."""
    with gym.make("shapechanger/Finger-v1", gap="real-like", finger_seed=0) as simulated:
        truth: FingerParameters = simulated.get_wrapper_attr("parameters")
    with gym.make("shapechanger/RemoteFinger-v1", twin="real-like", finger_seed=0) as rig:
        own: Any = rig.unwrapped
        gap = resolve_gap(own.identified_source(0)["gap"])
    found = gap.around
    # A command waits for the next tick of the guard, 10 ms.
    assert found.command_delay == pytest.approx(0.010, abs=PATH_DELAY_ERROR_S)
    assert gap.command_delay[0] < 0.010 < gap.command_delay[1]
    large = np.abs(truth.arms) > 2e-3
    np.testing.assert_allclose(found.arms[large], truth.arms[large], rtol=0.05)
    assert np.abs(NOMINAL.arms / np.where(large, truth.arms, 1.0) - 1.0)[large].max() > 0.15
    np.testing.assert_allclose(found.joint_stiffness, truth.joint_stiffness, rtol=0.2)
    assert found.tendon_stiffness == pytest.approx(truth.tendon_stiffness, rel=0.05)


def test_a_path_is_followed_on_its_own_twin() -> None:
    """Layout and target equal `FingerTrack-v1`'s, the start nearly; the reward uses true values."""
    path = {"kind": "circle", "radius": 0.012, "hz": 0.5}
    policy = load_policy(POLICIES["track"])
    errors: list[float] = []
    begins: list[Any] = []
    with (
        gym.make("shapechanger/FingerTrack-v1", path=path) as simulated,
        gym.make("shapechanger/RemoteFingerTrack-v1", path=path, twin="nominal") as rig,
    ):
        here: Any = simulated.unwrapped
        there: Any = rig.unwrapped
        assert here.observation_layout == there.observation_layout
        assert there.individual == ""
        for env in (simulated, rig):
            observation, info = env.reset(seed=7)
            begins.append((observation[:4], info["target"]))
            truncated = False
            while not truncated:
                observation, _, _, truncated, info = env.step(policy.act(observation[None])[0])
            errors.append(info["rms"])
        assert info["truncated_because"] == ""
        assert info["distance"] == pytest.approx(info["true_distance"], abs=1e-6)
        # Another path is set without a new connection.
        _, info = rig.reset(seed=8, options={"path": "line"})
        assert there.path == as_path("line")
        with pytest.raises(PathError, match="leaves the finger's reach"):
            rig.reset(options={"path": lambda t: (0.5, 0.0, 0.0)})
    (start, target), (sensed, same) = begins
    np.testing.assert_array_equal(same, target)
    np.testing.assert_allclose(sensed, start, atol=0.1)
    # The policy was trained without gears, delay and slew, so it follows with a larger error.
    assert errors[0] < 0.001 < errors[1] < 0.015


def test_actions_of_length_drive_servos_that_control_lengths(tmp_path: Path) -> None:
    """With `actions="length"` the env moves a rig in current-based position mode."""
    text = find_profile("finger").read_text()
    keys = 'control = "length"\nlongest_m = 0.03\nshortest_m = -0.05\nmodel ='
    path = tmp_path / "finger.toml"
    path.write_text(text.replace("model =", keys))
    flex = np.array([0.2, 0.2, -0.5, -0.5, 0.0, 0.0, 0.0], np.float32)
    with run_robot(path, clock="twin") as robot:
        with pytest.raises(FingerError, match='controls lengths, so actions must be "length"'):
            _env(robot, actions="tension")
        env = _env(robot, actions="length")
        start, info = env.reset(seed=2)
        unwrapped: Any = env.unwrapped
        with gym.make("shapechanger/Finger-v1", actions="length") as simulated:
            begins, _ = simulated.reset(seed=2)
        np.testing.assert_allclose(start[:4], begins[:4], atol=0.06)
        held = unwrapped._command.astype(np.float32)
        for _ in range(20):
            kept, *_, info = env.step(held)
        assert info["truncated_because"] == ""
        for _ in range(40):
            bent, *_ = env.step(held + flex)
        for _ in range(60):
            straight, *_, info = env.step(held - flex)
        env.close()
    assert info["truncated_because"] == ""
    np.testing.assert_allclose(kept[:4], start[:4], atol=0.15)
    assert bent[0] > straight[0] + 0.3
