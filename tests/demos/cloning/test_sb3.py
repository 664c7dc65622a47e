"""A clone as the beginning of reinforcement learning: at first it drives as the clone does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import SAC

from shapechanger.demos.cloning.pictures import PolicyError
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.demos.cloning.sb3 import NormedReLU, SeenByPolicy, from_sb3, to_sb3
from tests.demos.cloning.small import SIZE, SMALL

_SMALL_BUFFER: dict[str, Any] = {"buffer_size": 32, "batch_size": 4, "learning_starts": 4}


class _Road(gym.Env[np.ndarray, np.ndarray]):
    """Pictures in which there is nothing to see."""

    def __init__(self, size: tuple[int, int] = (60, 80), high: float = 1.0) -> None:
        self.observation_space = gym.spaces.Box(0, 255, (*size, 3), np.uint8)
        self.action_space = gym.spaces.Box(-high, high, (2,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        return self._picture(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        return self._picture(), float(action[1]), False, bool(self.np_random.uniform() < 0.1), {}

    def _picture(self) -> np.ndarray:
        shape = self.observation_space.shape
        assert shape is not None
        return self.np_random.integers(0, 256, shape, np.uint8)


@pytest.fixture
def policy() -> CameraPolicy:
    """A policy whose actions are not all near 0."""
    policy = CameraPolicy.fresh(SMALL, 1)
    with torch.no_grad():
        policy.network.hands.weight.mul_(20.0)
    return policy


def test_the_learner_begins_as_the_clone(policy: CameraPolicy) -> None:
    """The same picture, the same action, through all of Stable-Baselines3."""
    model = to_sb3(policy, _Road(), **_SMALL_BUFFER)
    pictures = np.random.default_rng(0).integers(0, 256, (16, 60, 80, 3), np.uint8)
    expected = policy.predict_many(pictures)
    assert np.abs(expected).max() > 0.2
    seen = policy.features(pictures)
    np.testing.assert_allclose(model.predict(seen, deterministic=True)[0], expected, atol=1e-5)
    one = model.predict(seen[0], deterministic=True)[0]
    np.testing.assert_allclose(one, policy.predict(pictures[0]), atol=1e-5)


def test_what_it_tries_is_close_to_that(policy: CameraPolicy) -> None:
    """A clone that began by driving at random would have been cloned for nothing."""
    model = to_sb3(policy, _Road(SIZE), **_SMALL_BUFFER)
    pictures = np.random.default_rng(0).integers(0, 256, (64, *SIZE, 3), np.uint8)
    tried = model.predict(policy.features(pictures), deterministic=False)[0]
    apart = np.abs(tried - policy.predict_many(pictures)).mean()
    assert 0.01 < apart < 0.2


def test_it_goes_on_learning_and_comes_back(policy: CameraPolicy, tmp_path: Path) -> None:
    """As a file of Stable-Baselines3, and as a clone that sees as before and acts otherwise."""
    before = policy.network.hands.weight.clone()
    picture = np.full((1, *SIZE, 3), 80, np.uint8)
    seen = policy.features(picture)
    model = to_sb3(policy, _Road(SIZE), **_SMALL_BUFFER)
    model.learn(12)
    assert torch.equal(policy.network.hands.weight, before)
    learned = from_sb3(model, policy)
    assert not torch.equal(learned.network.hands.weight, before)
    np.testing.assert_array_equal(learned.features(picture), seen)
    acted = model.predict(seen, deterministic=True)[0]
    np.testing.assert_allclose(learned.predict_many(picture), acted, atol=1e-5)
    model.save(tmp_path / "model.zip")
    again = SAC.load(tmp_path / "model.zip")
    np.testing.assert_array_equal(again.predict(seen, deterministic=True)[0], acted)


def test_settings_reach_the_learner(policy: CameraPolicy) -> None:
    """Except for the shape of the actor, which is the clone's."""
    kwargs = {"net_arch": {"pi": [], "qf": [16]}}
    model = to_sb3(policy, _Road(), gamma=0.9, policy_kwargs=kwargs, **_SMALL_BUFFER)
    assert model.gamma == 0.9
    assert model.critic.qf0[0].out_features == 16


def test_the_wrapper_shows_what_the_eyes_see(policy: CameraPolicy) -> None:
    """Features in place of the picture that the env itself shows."""
    env = SeenByPolicy(_Road(), policy)
    seen, _ = env.reset(seed=0)
    raw, _ = _Road().reset(seed=0)
    assert env.observation_space.contains(seen)
    np.testing.assert_array_equal(seen, policy.features(raw[None])[0])


def test_a_critic_is_freed_of_mean_and_spread() -> None:
    """However large its numbers grow, they come out alike."""
    x = torch.tensor([[1.0, 2.0, 4.0, 9.0]])
    torch.testing.assert_close(NormedReLU()(x), NormedReLU()(1000.0 * x + 5.0), atol=1e-3, rtol=0.0)


@pytest.mark.parametrize(
    ("env", "error", "words"),
    [
        (_Road(high=2.0), PolicyError, r"are in \[-1, 1\]"),
    ],
)
def test_an_env_that_does_not_fit_is_refused(
    policy: CameraPolicy, env: gym.Env[Any, Any], error: type[Exception], words: str
) -> None:
    """Before anything is learned."""
    with pytest.raises(error, match=words):
        to_sb3(policy, env)


def test_an_env_without_pictures_is_refused(policy: CameraPolicy) -> None:
    """Its numbers are no picture; and nothing steers a pole on a cart."""
    env = _Road()
    env.observation_space = gym.spaces.Box(0, 1, (4,), np.float32)
    with pytest.raises(PolicyError, match="observations are Box"):
        to_sb3(policy, env)
    env.action_space = gym.spaces.Discrete(2)  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(PolicyError, match="the env takes Discrete"):
        to_sb3(policy, env)
