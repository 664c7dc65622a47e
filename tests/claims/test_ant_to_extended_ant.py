"""Transfer of Ant policies to ExtendedAnt and back, for PPO and SAC."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO, SAC

from shapechanger.transfer.body_map import BodyMap, body_map
from shapechanger.transfer.transplant import transplant

STEPS = 30


@pytest.fixture(scope="module")
def ants() -> tuple[gym.Env[Any, Any], gym.Env[Any, Any], BodyMap]:
    """Both envs, and a body map in which each foot copies the command of its ankle."""
    ant, extended = gym.make("shapechanger/Ant-v1"), gym.make("shapechanger/ExtendedAnt-v1")
    return ant, extended, body_map(ant, extended, rules={"foot_*/motor": "copy ankle_*/motor"})


def perturbed_model(kind: type[PPO] | type[SAC], env: gym.Env[Any, Any]) -> Any:
    """Return an untrained model with weights large enough to matter."""
    settings: dict[str, Any] = {"n_steps": 64, "batch_size": 64} if kind is PPO else {}
    model = kind("MlpPolicy", env, device="cpu", seed=0, **settings)
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter += 0.05 * torch.randn(parameter.shape, generator=generator)
    return model


def rollout(model: Any, env: gym.Env[Any, Any]) -> list[NDArray[np.float64]]:
    """Return the observations of a rollout."""
    observation, _ = env.reset(seed=3)
    seen = [observation]
    for _ in range(STEPS):
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, _ = env.step(action)
        seen.append(observation)
        if terminated or truncated:
            break
    return seen


@pytest.mark.parametrize("kind", [PPO, SAC])
def test_the_transplanted_policy_acts_like_the_mapped_one(
    ants: tuple[gym.Env[Any, Any], gym.Env[Any, Any], BodyMap], kind: type[PPO] | type[SAC]
) -> None:
    """Actions on rollout observations agree to 1e-6."""
    ant, extended, crossing = ants
    source = perturbed_model(kind, ant)
    target = transplant(source, crossing, extended)
    seen = rollout(target, extended)
    assert len(seen) > 5
    for observation in seen:
        ours, _ = target.predict(observation, deterministic=True)
        theirs, _ = source.predict(crossing.adapt_observation(observation), deterministic=True)
        np.testing.assert_allclose(ours, crossing.adapt_action(theirs), atol=1e-6)


@pytest.mark.parametrize("kind", [PPO, SAC])
def test_transplanting_back_restores_the_policy(
    ants: tuple[gym.Env[Any, Any], gym.Env[Any, Any], BodyMap], kind: type[PPO] | type[SAC]
) -> None:
    """A policy that is moved from Ant to ExtendedAnt and back acts like the original policy."""
    ant, extended, crossing = ants
    source = perturbed_model(kind, ant)
    there = transplant(source, crossing, extended)
    back = transplant(there, crossing.inverse(), ant)
    for observation in rollout(source, ant):
        ours, _ = back.predict(observation, deterministic=True)
        theirs, _ = source.predict(observation, deterministic=True)
        np.testing.assert_allclose(ours, theirs, atol=1e-6)
