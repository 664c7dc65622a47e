"""Body maps between envs, and `MappedEnv`."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from shapechanger.errors import LayoutError, SpaceMismatch
from shapechanger.transfer.body_map import BodyMap, Copy, Learn, MappedEnv, body_map
from tests.transfer.body_map.bodies import ant_action, ant_observation


class Recorder(gym.Env[np.ndarray, np.ndarray]):
    """An env with the layouts of an ant, which records its actions."""

    def __init__(self, *, feet: bool = False) -> None:
        self.observation_layout = ant_observation(feet=feet)
        self.action_layout = ant_action(feet=feet)
        n = self.observation_layout.size
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (n,), np.float64)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (self.action_layout.size,), np.float32)
        self.moved: list[np.ndarray] = []

    def sensed(self) -> np.ndarray:
        return np.linspace(-0.3, 0.3, self.observation_layout.size) + len(self.moved)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, Any]:
        super().reset(seed=seed)
        return self.sensed(), {"options": options}

    def step(self, action: Any) -> Any:
        self.moved.append(action)
        return self.sensed(), 2.5, True, False, {"moved": action}


def test_envs_are_mapped_by_their_layouts() -> None:
    built = body_map(Recorder(), gym.wrappers.TimeLimit(Recorder(feet=True), 5), otherwise="learn")
    assert built.source_action == ant_action()
    assert built.target_action == ant_action(feet=True)
    assert built.action[-1].rule == Learn()
    silent = Recorder()
    del silent.action_layout
    with pytest.raises(LayoutError, match="publishes no observation_layout and action_layout"):
        body_map(Recorder(), silent)


def test_a_mapped_env_adapts_observations_and_actions() -> None:
    """Observations are the source's, and actions move the target's motors."""
    source, target = Recorder(), Recorder(feet=True)
    built = body_map(source, target, rules={"foot_*/motor": "copy ankle_*/motor"})
    env = MappedEnv(target, built)
    assert (env.observation_layout, env.action_layout) == (ant_observation(), ant_action())
    assert body_map(source, env) == BodyMap.identity(ant_observation(), ant_action())
    np.testing.assert_array_equal(env.observation_space.high, source.observation_layout.high)
    assert env.action_space == source.action_space
    observation, info = env.reset(seed=3, options={"a": 1})
    assert info == {"options": {"a": 1}}
    assert target.np_random_seed == 3
    np.testing.assert_array_equal(observation, built.adapt_observation(target.sensed()))
    action = np.linspace(-1.0, 1.0, 8).astype(np.float32)
    observation, reward, terminated, truncated, _ = env.step(action)
    assert (reward, terminated, truncated) == (2.5, True, False)
    np.testing.assert_array_equal(observation, built.adapt_observation(target.sensed()))
    np.testing.assert_array_equal(target.moved[0], built.adapt_action(action))
    assert target.moved[0].dtype == np.float32
    target.sensed = lambda: np.zeros(target.observation_layout.size, np.float32)
    assert env.reset()[0].dtype == observation.dtype == env.observation_space.dtype == np.float64


def test_a_space_of_the_wrong_size_is_refused() -> None:
    built = body_map(Recorder(), Recorder(feet=True))
    with pytest.raises(SpaceMismatch, match=r"target observation has 59 numbers"):
        MappedEnv(Recorder(), built)
    target = Recorder(feet=True)
    target.action_space = gym.spaces.Box(-1.0, 1.0, (7,))
    with pytest.raises(SpaceMismatch, match="The layout of the target action has 12"):
        MappedEnv(target, built)


def test_a_mapped_env_is_rebuilt_from_its_spec() -> None:
    """The spec holds the map as JSON, so an env can be made from it."""
    gym.register("body_map_test/Recorder-v0", f"{__name__}:Recorder", kwargs={"feet": True})
    try:
        target = gym.make("body_map_test/Recorder-v0", disable_env_checker=True)
        built = body_map(Recorder(), target, action_rules={"foot_1/motor": Copy("hip_1/motor")})
        spec = MappedEnv(target, built).spec
        again = gym.make(EnvSpec.from_json(spec.to_json()), disable_env_checker=True)
    finally:
        del gym.registry["body_map_test/Recorder-v0"]
    assert isinstance(again, MappedEnv)
    assert again.body_map == built
