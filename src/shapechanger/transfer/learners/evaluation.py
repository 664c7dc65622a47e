"""Evaluation of policies: whole episodes, with the same starts for every trained policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, cast

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import (
    RETURN,
    EnvRef,
    Measure,
    hold_out,
    is_reward_term,
    is_single_instance,
    measures_of,
)
from shapechanger.errors import require_known

EVALUATION_SEED: Final = 10_000_000
"""Smallest seed of an episode that evaluates a trained policy."""
# Option of an env that selects one of many bodies by its seed.
_INDIVIDUAL: Final = "finger_seed"
# Largest numbers of bodies, and of episodes per body, that get distinct seeds below 2^32.
_MOST_INDIVIDUALS: Final = 100_000
_MOST_EPISODES: Final = 10_000

# Maps observations of shape (n, ...) to actions of shape (n, ...).
Act = Callable[[NDArray[Any]], NDArray[Any]]


class Evaluation(msgspec.Struct, frozen=True):
    """Result of evaluating a policy after `steps` env steps of training in this env.

    Attributes:
        mean_return: Mean undiscounted return over the episodes.
        mean_length: Mean length of the episodes, in steps.
        terms: Mean sum over an episode of each reward term that the env reports.
        success: Share of the episodes whose last `info["is_success"]` is true; None if the env does
            not report success.
        measures: Mean of each measure of the env except the return, keyed by name.
        standing: Share of the steps whose `info["standing"]` is true, which only vehicles report;
            None if the env does not report it.
    """

    steps: int
    mean_return: float
    mean_length: float
    terms: dict[str, float] = {}
    success: float | None = None
    measures: dict[str, float] = {}
    standing: float | None = None

    def value(self, measure: str) -> float:
        """Return the value of a measure, or the sum of a reward term."""
        known = {RETURN.name: self.mean_return, **self.measures, **self.terms}
        require_known("measure", known, measure)
        return known[measure]


def evaluation_seed(env: EnvRef, episodes: int) -> int:
    """Return the seed of the first evaluation episode in an env.

    The seed is the same for all trained policies, so arms are compared on equal episodes. Each
    individual body, such as one of many random fingers, has its own seeds, so that a mean over
    bodies is also a mean over many tasks.
    """
    individual = int(env.kwargs.get(_INDIVIDUAL) or 0) % _MOST_INDIVIDUALS
    return EVALUATION_SEED + min(episodes, _MOST_EPISODES) * individual


def evaluation_envs(
    env: EnvRef, episodes: int, limit: int | None = None
) -> list[gym.Env[Any, Any]]:
    """Make an env per episode, or the only possible one, with held-out surroundings if any."""
    more = {} if limit is None else {"max_episode_steps": limit}
    envs = [env.make(**more)]
    if not is_single_instance(envs[0]):
        envs += [env.make(**more) for _ in range(episodes - 1)]
    for one in envs:
        hold_out(one)
    return envs


def evaluate(
    act: Act,
    envs: Sequence[gym.Env[Any, Any]],
    seed: int,
    steps: int = 0,
    episodes: int | None = None,
) -> Evaluation:
    """Return the averages over a policy's episodes, whose seeds count up from `seed`.

    `episodes` is rounded up to a multiple of the number of envs; None for one episode per env.
    """
    played: list[_Episode] = []
    for first in range(0, len(envs) if episodes is None else episodes, len(envs)):
        played += _play(act, envs, seed + first)
    stood = [each.stood for each in played if each.stood is not None]
    reached = [each.success for each in played if each.success is not None]
    return Evaluation(
        steps,
        float(np.mean([each.total for each in played])),
        float(np.mean([each.length for each in played])),
        _means([each.terms for each in played]),
        float(np.mean(reached)) if reached else None,
        _means([each.measures for each in played]),
        sum(stood) / sum(each.length for each in played) if stood else None,
    )


def _means(episodes: Sequence[dict[str, float]]) -> dict[str, float]:
    """Average each named number over all episodes; a missing one counts as 0."""
    names = dict.fromkeys(name for episode in episodes for name in episode)
    return {name: sum(e.get(name, 0.0) for e in episodes) / len(episodes) for name in names}


@dataclass(slots=True)
class _Episode:
    total: float = 0.0
    length: int = 0
    terms: dict[str, float] = field(default_factory=dict[str, float])
    success: bool | None = None
    stood: int | None = None
    measures: dict[str, float] = field(default_factory=dict[str, float])

    def add(self, reward: float, info: Mapping[str, Any], measures: Sequence[Measure]) -> None:
        self.total += reward
        self.length += 1
        for name, value in info.items():
            # Ants report their control cost as NumPy's float32, which is not a Python float.
            if is_reward_term(name) and isinstance(value, int | float | np.floating):
                self.terms[name] = self.terms.get(name, 0.0) + float(cast("float", value))
        if "is_success" in info:
            self.success = bool(info["is_success"])
        if "standing" in info:
            self.stood = (self.stood or 0) + bool(info["standing"])
        for measure in measures:
            if measure.key in info:
                before = self.measures.get(measure.name, 0.0) if measure.over == "episode" else 0.0
                self.measures[measure.name] = float(info[measure.key]) + before

    def end(self, measures: Sequence[Measure], limit: int | None) -> None:
        """Divide sums by the time limit in steps, or by the episode's length without a limit."""
        for measure in measures:
            if measure.over == "episode" and measure.name in self.measures:
                self.measures[measure.name] /= limit or self.length


def _play(act: Act, envs: Sequence[gym.Env[Any, Any]], seed: int) -> list[_Episode]:
    observations = np.stack([env.reset(seed=seed + i)[0] for i, env in enumerate(envs)])
    episodes, alive = [_Episode() for _ in envs], list(range(len(envs)))
    measures = [measure for measure in measures_of(envs[0]) if measure.key]
    limit = None if envs[0].spec is None else envs[0].spec.max_episode_steps
    while alive:
        for i, action in zip([*alive], act(observations[alive]), strict=True):
            observations[i], reward, terminated, truncated, info = envs[i].step(action)
            episodes[i].add(float(reward), info, measures)
            if terminated or truncated:
                episodes[i].end(measures, limit)
                alive.remove(i)
    return episodes


def random_actions(space: gym.Space[Any], seed: int) -> Act:
    """Return a policy that draws its actions from the space, with this seed."""
    space.seed(seed)
    return lambda observations: np.stack([space.sample() for _ in observations])


def zero_actions(space: gym.Space[Any]) -> Act:
    """Return a policy that always takes the action nearest to zero."""
    box = cast("gym.spaces.Box", space)
    action = np.clip(np.zeros(box.shape, box.dtype), box.low, box.high)
    return lambda observations: np.stack([action] * len(observations))
