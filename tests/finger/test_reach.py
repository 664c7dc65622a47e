"""`Finger-v1`: episodes, observations, rewards and errors; and the controller in both tasks."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.errors import BadAction, FingerError, UnknownName
from shapechanger.finger.anatomy import JOINT_REST, TENDONS
from shapechanger.finger.controller import FingerController
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.finger.task import fingertip
from shapechanger.finger.tensions import DRIVES
from shapechanger.finger.track import FingerTrackEnv

_NOTHING = np.zeros(7, np.float32)
_REST = JOINT_REST.tolist()


def _state(env: FingerReachEnv) -> np.ndarray:
    data = env.plant.data
    return np.concatenate([data.qpos, data.qvel, data.act, data.ctrl, [data.time]])


def test_success_needs_ten_steps_at_the_target() -> None:
    """Success begins after ten steps within 5 mm, and ends when the fingertip leaves."""
    env = FingerReachEnv()
    env.reset(seed=0)
    controller = FingerController(env.observation_layout)
    seen, info = env.reset(options={"posture": _REST, "target": _REST})
    assert info["distance"] < 1e-9
    assert not info["is_success"]
    for step in range(1, 13):
        seen, _, _, _, info = env.step(controller(seen))
        assert info["distance"] < 0.005
        assert info["is_success"] == (step >= 10)
    while info["distance"] < 0.005:
        assert info["is_success"]
        _, _, _, _, info = env.step(np.array([1, 1, -1, -1, -1, -1, -1], np.float32))
    assert not info["is_success"]
    assert not env.reset(seed=0)[1]["is_success"]


def test_observations_match_their_names() -> None:
    env = FingerReachEnv()
    env.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(5):
        seen, _, _, _, info = env.step(rng.uniform(-1, 1, 7).astype(np.float32))
        named = dict(zip(env.observation_layout.names, seen, strict=True))
        data = env.plant.data
        assert named["PIP_flexion/angle"] == data.joint("PIP_flexion").qpos[0]
        assert named["DIP_flexion/velocity"] == data.joint("DIP_flexion").qvel[0]
        for i, tendon in enumerate(TENDONS):
            assert named[f"{tendon}/tension"] == -data.actuator_force[i]
            assert named[f"{tendon}/command"] == data.ctrl[i]
        tip = np.array([named[f"fingertip/{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(tip, env.plant.fingertip, atol=1e-12)
        way = np.array([named[f"target/d{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(tip + way, info["target"], atol=1e-12)
        assert info["distance"] == pytest.approx(np.linalg.norm(way))


def test_effort_is_the_mean_square_of_relative_tensions() -> None:
    env = FingerReachEnv(reward={"nearness": 10.0})
    env.reset(seed=0)
    *_, info = env.step(_NOTHING)
    share = env.plant.data.actuator_force / np.array(NOMINAL.most_tension)
    assert info["reward_effort"] == pytest.approx(-0.02 * np.mean(share**2))
    assert 0.0 < info["reward_nearness"] <= 0.2


def test_goal_rewards_match_compute_reward() -> None:
    """`step` and the batched `compute_reward` agree: 0 within 5 mm, otherwise -1."""
    env, plain = FingerReachEnv(goal=True), FingerReachEnv()
    numbers, _ = plain.reset(seed=4)
    parts, _ = env.reset(seed=4)
    np.testing.assert_array_equal(numbers[:32], parts["observation"])
    np.testing.assert_array_equal(numbers[32:35], parts["desired_goal"])
    np.testing.assert_array_equal(numbers[29:32], parts["achieved_goal"])
    still = JOINT_REST + 0.01
    goals, rewards = [], []
    for target in (_REST, still.tolist(), (0.05, 0.01, -0.04)):
        env.reset(seed=0, options={"posture": _REST, "target": target})
        for _ in range(3):
            seen, reward, _, _, info = env.step(_NOTHING)
            assert reward == info["reward_goal"]
            goals.append((seen["achieved_goal"], seen["desired_goal"]))
            rewards.append(reward)
    assert set(rewards) == {0.0, -1.0}
    achieved, desired = np.array(goals).transpose(1, 0, 2)
    np.testing.assert_array_equal(env.compute_reward(achieved, desired, [{}] * 9), rewards)
    square = env.compute_reward(np.zeros((3, 2, 3)), np.full((3, 2, 3), 0.0028), None)
    np.testing.assert_array_equal(square, np.zeros((3, 2)))
    assert env.compute_reward(np.zeros(3), np.array([0.0051, 0.0, 0.0]), None) == -1.0


@pytest.mark.parametrize(
    ("action", "sentence"),
    [
        (np.array([0, 0, 0, np.nan, 0, 0, 0]), "takes finite actions, got nan for EDC/command"),
        (np.zeros(6), r"takes actions of shape \(7,\), got \(6,\)"),
        (np.array(["a"] * 7), "takes numbers as actions"),
    ],
)
def test_invalid_actions_are_refused(action: Any, sentence: str) -> None:
    env = FingerReachEnv()
    with pytest.raises(gym.error.ResetNeeded, match=r"Call reset\(\)"):
        env.step(_NOTHING)
    env.reset(seed=0)
    env.step(_NOTHING)
    before = _state(env)
    with pytest.raises(BadAction, match=sentence):
        env.step(action)
    np.testing.assert_array_equal(_state(env), before)


def test_options_set_start_and_target() -> None:
    env = FingerReachEnv()
    _, info = env.reset(seed=0, options={"posture": [0.5, 0.1, 0.6, 0.3]})
    np.testing.assert_array_equal(env.plant.angles, [0.5, 0.1, 0.6, 0.3])
    other = env.reset(options={"posture": [0.5, 0.1, 0.6, 0.3]})[1]
    assert (info["target"] != other["target"]).all()
    info = env.reset(options={"target": _REST})[1]
    np.testing.assert_allclose(info["target"], fingertip(JOINT_REST))
    assert (env.plant.angles != JOINT_REST).all()
    info = env.reset(options={"target": (0.05, 0.01, -0.04)})[1]
    np.testing.assert_array_equal(info["target"], (0.05, 0.01, -0.04))


def test_noise_affects_observations_only() -> None:
    """Angles and tensions have the given standard deviations; the distance is exact."""
    env = FingerReachEnv(parameters={"joint_noise": 0.02, "tension_noise": 0.3})
    env.reset(seed=0)
    off, tensions = [], []
    for _ in range(100):
        seen, _, _, _, info = env.step(_NOTHING)
        off.append(seen[:4] - env.plant.angles)
        tensions.append(seen[8:15] + env.plant.data.actuator_force)
        true = np.linalg.norm(env.plant.fingertip - info["target"])
        assert info["distance"] == pytest.approx(true)
    assert np.std(off) == pytest.approx(0.02, rel=0.15)
    assert np.std(tensions) == pytest.approx(0.3, rel=0.15)


@pytest.mark.parametrize("actions", ["impedance", "tension", "length"])
def test_an_episode_starts_at_rest_with_any_delay(actions: str) -> None:
    """Until the first command acts, tendons are just taut, also after another episode."""
    for parameters in ({}, {"command_delay": 0.040}):
        env = FingerReachEnv(actions=actions, parameters=parameters)
        for _ in range(2):
            env.reset(seed=0, options={"posture": _REST})
            still = env.plant.data.ctrl.astype(np.float32)
            env.step(still)
            assert np.abs(env.plant.data.actuator_force).max() < 1.5
            assert np.degrees(np.abs(env.plant.angles - JOINT_REST)).max() < 2.0
            for _ in range(5):
                env.step(np.ones(7, np.float32))


@pytest.mark.parametrize(
    ("arguments", "options", "error", "sentence"),
    [
        ({"actions": "tensions"}, {}, UnknownName, "'tensions'. Did you mean 'tension'"),
        ({"gap": "wide", "parameters": NOMINAL}, {}, FingerError, "Give either parameters or a"),
        ({"finger_seed": 2}, {}, FingerError, "give a gap too"),
        ({"parameters": {"fricton": 1.0}}, {}, UnknownName, "No parameter of .*'fricton'"),
        ({"parameters": "{}x"}, {}, FingerError, "Invalid finger parameters"),
        ({"reward": {"effrt": 1.0}}, {}, UnknownName, "'effrt'. Did you mean 'effort'"),
        ({}, {"path": "circle"}, UnknownName, "There are: posture, target"),
        ({}, {"posture": [0.0, 0.0]}, FingerError, "four angles in rad, MCP_flexion, .*; got"),
        ({}, {"posture": [2.0, 0.0, 0.0, 0.0]}, FingerError, r"within \[-0.349.* and \[1.571"),
        ({}, {"target": [0.1, np.nan, 0.0]}, FingerError, "three finite numbers, m"),
    ],
)
def test_invalid_arguments_and_options_are_refused(
    arguments: dict[str, Any], options: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    """Arguments are refused when the env is made, options at a reset."""
    env = FingerReachEnv() if options else None
    with pytest.raises(error, match=sentence):
        env.reset(seed=0, options=options) if env else FingerReachEnv(**arguments)


# Steps until the target is reached: 1.2 s of an episode of 2 s.
_ARRIVES = 60


@pytest.mark.parametrize("actions", DRIVES)
def test_the_controller_reaches_every_target(actions: str) -> None:
    env = FingerReachEnv(actions=actions)
    controller = FingerController(env.observation_layout, actions)
    distances: list[float] = []
    for seed in range(20):
        seen, info = env.reset(seed=seed)
        controller.reset()
        for _ in range(_ARRIVES):
            seen, _, _, _, info = env.step(controller(seen))
        assert info["is_success"]
        distances.append(info["distance"])
    assert np.median(distances) < 1e-4


@pytest.mark.parametrize("actions", DRIVES)
def test_the_controller_follows_a_circle(actions: str) -> None:
    env = FingerTrackEnv(actions=actions, path={"kind": "circle", "radius": 0.012, "hz": 1.0})
    controller = FingerController(env.observation_layout, actions)
    seen, info = env.reset(seed=0)
    controller.reset()
    for _ in range(125):
        seen, _, _, _, info = env.step(controller(seen))
    assert info["rms"] < 0.003
    assert info["is_success"]
