"""How good a policy is: whole episodes, from starts that are the same for every policy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.learners.settings import LearnerSettings, Settings

__all__ = [
    "Act",
    "Evaluation",
    "evaluate",
    "evaluation_envs",
    "is_single_instance",
    "random_actions",
]

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
        success: Share of the episodes whose last `info["is_success"]` is true; None of an env that
            says nothing of success.
    """

    steps: int
    mean_return: float
    mean_length: float
    terms: dict[str, float] = {}
    success: float | None = None


def is_single_instance(env: gym.Env[Any, Any]) -> bool:
    """Whether there is but one of it, as of a robot: an env says so by `side_by_side = False`."""
    return not getattr(env.unwrapped, "side_by_side", True)


def evaluation_envs(env: EnvRef, settings: Settings) -> list[gym.Env[Any, Any]]:
    """The envs in which policies of one learner are judged: one for each episode, or one for all.

    An env that has surroundings to hold out, and says so by a method `hold_out`, is judged there.
    """
    more = {}
    if not isinstance(settings, LearnerSettings):
        more["max_episode_steps"] = settings.eval_steps
    envs = [env.make(**more)]
    if not is_single_instance(envs[0]):
        envs += [env.make(**more) for _ in range(settings.eval_episodes - 1)]
    for one in envs:
        hold_out = getattr(one.unwrapped, "hold_out", None)
        if hold_out is not None:
            hold_out()
    return envs


def evaluate(
    act: Act,
    envs: Sequence[gym.Env[Any, Any]],
    seed: int,
    steps: int = 0,
    episodes: int | None = None,
) -> Evaluation:
    """Play some episodes and take the mean.

    Args:
        act: The policy.
        envs: The envs; each ends its episodes by itself.
        seed: The first episode starts from this seed, the next from the next.
        steps: Recorded with the result.
        episodes: How many, side by side in all envs and again in all of them until there are so
            many; one in each env if not given.
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
    """What has come of one episode so far."""

    total: float = 0.0
    length: int = 0
    terms: dict[str, float] = field(default_factory=dict[str, float])
    success: bool | None = None


def _play(act: Act, envs: Sequence[gym.Env[Any, Any]], seed: int) -> list[_Episode]:
    """One episode in each env, side by side."""
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
    """A policy that draws each action uniformly from its space."""
    space.seed(seed)
    return lambda observations: np.stack([space.sample() for _ in observations])
