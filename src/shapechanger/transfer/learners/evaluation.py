"""Evaluation of policies: whole episodes from starts that are the same for every policy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.transfer.env_ref import EnvRef, HasHeldOutStarts, is_single_instance
from shapechanger.transfer.learners.settings import Settings

__all__ = [
    "Act",
    "Evaluation",
    "evaluate",
    "evaluation_envs",
    "random_actions",
]

# Observations of shape (n, ...) in, actions of shape (n, ...) out.
Act = Callable[[NDArray[Any]], NDArray[Any]]


class Evaluation(msgspec.Struct, frozen=True):
    """Result of evaluating a policy after a number of training steps.

    Attributes:
        steps: Env steps of training in this env before the evaluation.
        mean_return: Mean undiscounted return over the episodes.
        mean_length: Mean length of the episodes, in steps.
        terms: Mean sum over an episode of each reward term that the env reports.
        success: Share of the episodes whose last `info["is_success"]` is true; None if the env does
            not report success.
    """

    steps: int
    mean_return: float
    mean_length: float
    terms: dict[str, float] = {}
    success: float | None = None


def evaluation_envs(env: EnvRef, settings: Settings) -> list[gym.Env[Any, Any]]:
    """Make the envs in which a learner's policies are evaluated, in held-out surroundings if any.

    Args:
        env: The env.
        settings: Settings of the learner.

    Returns:
        One env for each episode; a single env if only one instance can exist.
    """
    limit = settings.episode_limit
    more = {} if limit is None else {"max_episode_steps": limit}
    envs = [env.make(**more)]
    if not is_single_instance(envs[0]):
        envs += [env.make(**more) for _ in range(settings.eval_episodes - 1)]
    for one in envs:
        if isinstance(one.unwrapped, HasHeldOutStarts):
            one.unwrapped.hold_out()
    return envs


def evaluate(
    act: Act,
    envs: Sequence[gym.Env[Any, Any]],
    seed: int,
    steps: int = 0,
    episodes: int | None = None,
) -> Evaluation:
    """Average over episodes.

    Args:
        act: The policy.
        envs: The envs; each ends its episodes by itself.
        seed: Seed of the first episode; it increases by one per episode.
        steps: Training steps so far, for the result.
        episodes: Number of episodes, rounded up to a multiple of the envs; one per env by default.
    """
    played: list[_Episode] = []
    for first in range(0, len(envs) if episodes is None else episodes, len(envs)):
        played += _play(act, envs, seed + first)
    terms: dict[str, float] = {}
    for episode in played:
        for name, value in episode.terms.items():
            terms[name] = terms.get(name, 0.0) + value / len(played)
    reached = [episode.success for episode in played if episode.success is not None]
    return Evaluation(
        steps,
        float(np.mean([episode.total for episode in played])),
        float(np.mean([episode.length for episode in played])),
        terms,
        float(np.mean(reached)) if reached else None,
    )


@dataclass(slots=True)
class _Episode:
    """Sums over one episode."""

    total: float = 0.0
    length: int = 0
    terms: dict[str, float] = field(default_factory=dict[str, float])
    success: bool | None = None


def _play(act: Act, envs: Sequence[gym.Env[Any, Any]], seed: int) -> list[_Episode]:
    """Run one episode in each env in parallel."""
    starts = [env.reset(seed=seed + i)[0] for i, env in enumerate(envs)]
    observations = np.stack(starts)
    episodes = [_Episode() for _ in envs]
    alive = list(range(len(envs)))
    while alive:
        actions = act(observations[alive])
        still: list[int] = []
        for i, action in zip(alive, actions, strict=True):
            observation, reward, terminated, truncated, info = envs[i].step(action)
            observations[i] = observation
            episode = episodes[i]
            episode.total += float(reward)
            episode.length += 1
            for name, value in info.items():
                if name.startswith("reward_") and isinstance(value, float | int):
                    episode.terms[name] = episode.terms.get(name, 0.0) + float(value)
            if "is_success" in info:
                episode.success = bool(info["is_success"])
            if not (terminated or truncated):
                still.append(i)
        alive = still
    return episodes


def random_actions(space: gym.Space[Any], seed: int) -> Act:
    """Return a policy that draws actions uniformly from `space`."""
    space.seed(seed)
    return lambda observations: np.stack([space.sample() for _ in observations])
