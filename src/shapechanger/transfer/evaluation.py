"""How good a policy is: whole episodes, from starts that are the same for every policy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.settings import LearnerSettings, Settings

__all__ = ["Act", "Evaluation", "evaluate", "evaluation_envs", "random_actions"]

# Observations of shape (n, ...) in, actions of shape (n, ...) out.
Act = Callable[[NDArray[Any]], NDArray[Any]]


class Evaluation(msgspec.Struct, frozen=True):
    """What a policy was worth after a number of steps of training.

    Attributes:
        steps: Env steps of training in this env before the evaluation.
        mean_return: Mean undiscounted return over the episodes.
        mean_length: Mean length of the episodes, in steps.
        terms: For each reward term that the env reports its mean sum over an episode. A high return
            of an ant that stands still shows here.
    """

    steps: int
    mean_return: float
    mean_length: float
    terms: dict[str, float] = {}


def evaluation_envs(env: EnvRef, settings: Settings) -> list[gym.Env[Any, Any]]:
    """The envs in which policies of one learner are judged, one for each episode.

    An env that has surroundings to hold out, and says so by a method `hold_out`, is judged there.
    """
    more = {}
    if not isinstance(settings, LearnerSettings):
        more["max_episode_steps"] = settings.eval_steps
    envs = [env.make(**more) for _ in range(settings.eval_episodes)]
    for one in envs:
        hold_out = getattr(one.unwrapped, "hold_out", None)
        if hold_out is not None:
            hold_out()
    return envs


def evaluate(act: Act, envs: Sequence[gym.Env[Any, Any]], seed: int, steps: int = 0) -> Evaluation:
    """Play one episode in each env and take the mean.

    Args:
        act: The policy.
        envs: The envs; each ends its episodes by itself.
        seed: The first env starts from this seed, the next from the next.
        steps: Recorded with the result.
    """
    starts = [env.reset(seed=seed + i)[0] for i, env in enumerate(envs)]
    observations = np.stack(starts)
    returns = np.zeros(len(envs))
    lengths = np.zeros(len(envs))
    terms: dict[str, float] = {}
    alive = list(range(len(envs)))
    while alive:
        actions = act(observations[alive])
        still: list[int] = []
        for i, action in zip(alive, actions, strict=True):
            observation, reward, terminated, truncated, info = envs[i].step(action)
            observations[i] = observation
            returns[i] += float(reward)
            lengths[i] += 1
            for name, value in info.items():
                if name.startswith("reward_") and isinstance(value, float | int):
                    terms[name] = terms.get(name, 0.0) + float(value) / len(envs)
            if not (terminated or truncated):
                still.append(i)
        alive = still
    return Evaluation(steps, float(returns.mean()), float(lengths.mean()), terms)


def random_actions(space: gym.Space[Any], seed: int) -> Act:
    """A policy that draws each action uniformly from its space."""
    space.seed(seed)
    return lambda observations: np.stack([space.sample() for _ in observations])
