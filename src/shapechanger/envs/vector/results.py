"""One env of a vector env, and the results of a step of all of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import TunedStep

# Indices of mjWARN_BADQPOS, mjWARN_BADQVEL and mjWARN_BADQACC in `data.warning`.
_BAD_STATE: Final = slice(3, 6)

Step = tuple[Any, Any, Any, dict[str, Any]]
"""Reward, terminated, truncated and info of one env."""


class InfoColumns(NamedTuple):
    """Infos of envs that have the same keys.

    Attributes:
        numbers: The numbers of the envs, ascending.
        values: One value per env for each key.
    """

    numbers: Sequence[int]
    values: Mapping[str, Sequence[Any] | NDArray[Any]]


def in_columns(numbers: Sequence[int], infos: Sequence[Mapping[str, Any]]) -> list[InfoColumns]:
    """Group the infos of some envs by their keys, including the keys of nested infos.

    Args:
        numbers: Numbers of the envs.
        infos: The info of each.
    """
    groups: dict[tuple[Any, ...], list[int]] = {}
    for place, info in enumerate(infos):
        groups.setdefault(_keys(info), []).append(place)
    return [
        InfoColumns(
            [numbers[place] for place in places],
            {key: [infos[place][key] for place in places] for key in infos[places[0]]},
        )
        for places in groups.values()
    ]


def _keys(info: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the keys of an info; a nested info stands as a pair of its key and its keys.

    Two envs whose nested infos differ must not share a group: the keys of the batch would come in
    another order than Gymnasium's.
    """
    return tuple(
        (key, _keys(cast("dict[str, Any]", value))) if isinstance(value, dict) else key
        for key, value in info.items()
    )


def batched(
    parts: Iterable[InfoColumns], num_envs: int, batch: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return the infos of all envs as Gymnasium's vector envs do.

    For each key there is an array of one entry per env, and under `_key` a mask of the envs that
    have one. Gymnasium adds one env after another, key by key. Adding envs whose infos have the
    same keys together takes a tenth of the time.

    Args:
        parts: The infos of the envs that have any.
        num_envs: How many envs there are.
        batch: Infos to which these are added, in place; None for new ones.
    """
    batch = {} if batch is None else batch
    # The lowest env first, as it sets the dtypes.
    for numbers, values in sorted(parts, key=lambda part: part.numbers[0]):
        where = _where(numbers, num_envs)
        masks = np.zeros((len(values), num_envs), np.bool_)
        masks[:, where] = True
        for (key, column), mask in zip(values.items(), masks, strict=True):
            if isinstance(column[0], dict) and key != "final_obs":
                nested = in_columns(numbers, cast("Sequence[Any]", column))
                batch[key] = batched(nested, num_envs, batch.get(key))
            elif key not in batch and isinstance(column, np.ndarray) and column.size == num_envs:
                batch[key] = column.copy()
            else:
                if key not in batch:
                    batch[key] = _empty(key, column, num_envs)
                array = batch[key]
                if array.dtype == np.object_:  # Numbers and arrays in it stay what they are.
                    for number, value in zip(numbers, column, strict=True):
                        array[number] = value
                else:
                    array[where] = column
            name = f"_{key}"
            batch[name] = batch[name] | mask if name in batch else mask
    return batch


def _empty(key: str, values: Sequence[Any] | NDArray[Any], num_envs: int) -> NDArray[Any]:
    """Return an array of all envs for values such as these."""
    if isinstance(values, np.ndarray):
        return np.zeros(num_envs, values.dtype)
    first: Any = values[0]
    # NumPy's booleans get an array of objects, as in Gymnasium.
    if type(first) in (int, float, bool) or isinstance(first, np.number):
        return np.zeros(num_envs, np.asarray(cast("Any", first)).dtype)
    if isinstance(first, np.ndarray) and key != "final_obs":
        array = cast("NDArray[Any]", first)
        return np.zeros((num_envs, *array.shape), array.dtype)
    return np.full(num_envs, None, np.object_)


def _where(numbers: Sequence[int], num_envs: int) -> slice | NDArray[np.intp]:
    """Return the index of envs in arrays of all envs; a slice, which copies nothing, for all."""
    return slice(None) if len(numbers) == num_envs else np.asarray(numbers)


class Restart(NamedTuple):
    """A reset that followed the end of an episode within the same step.

    Attributes:
        final_observation: The last observation of the episode.
        info: The info of the reset.
    """

    final_observation: NDArray[Any]
    info: dict[str, Any]


class StepResults:
    """Results of one step of all envs; threads may fill in different envs at the same time.

    Infos that arrive in columns stay columns until they are needed env by env.

    Args:
        num_envs: How many envs there are.

    Attributes:
        rewards: Shape (n,).
        terminated: Whether the step ended each episode, shape (n,).
        truncated: Whether each episode was cut off, shape (n,).
        restarts: The envs that were reset within the step, by number.
    """

    def __init__(self, num_envs: int) -> None:
        self.rewards = np.zeros(num_envs, np.float64)
        self.terminated = np.zeros(num_envs, np.bool_)
        self.truncated = np.zeros(num_envs, np.bool_)
        self.restarts: dict[int, Restart] = {}
        self._infos: dict[int, dict[str, Any]] = {}
        self._columns: list[InfoColumns] = []

    def put(self, number: int, step: Step) -> None:
        """Set the result of one env."""
        reward, terminated, truncated, info = step
        self.rewards[number] = reward
        self.terminated[number] = terminated
        self.truncated[number] = truncated
        self._infos[number] = info

    def put_columns(
        self,
        infos: InfoColumns,
        rewards: NDArray[Any],
        terminated: NDArray[np.bool_],
        truncated: list[bool],
    ) -> None:
        """Set the results of several envs, whose numbers come with their infos."""
        where = _where(infos.numbers, self.rewards.size)
        self.rewards[where] = rewards
        self.terminated[where] = terminated
        self.truncated[where] = truncated
        self._columns.append(infos)

    def info(self, number: int) -> dict[str, Any]:
        """Return the info of one env."""
        self._expand()
        return self._infos[number]

    def of_each(self) -> list[dict[str, Any]]:
        """Return the info of each env."""
        self._expand()
        return [self._infos[number] for number in range(self.rewards.size)]

    def batched(self) -> dict[str, Any]:
        """Return all infos as Gymnasium's vector envs do, including the infos of restarts."""
        if self.restarts:
            self._expand()
        numbers = sorted(self._infos)
        infos = in_columns(numbers, [self._with_restart(number) for number in numbers])
        return batched([*self._columns, *infos], self.rewards.size)

    def _expand(self) -> None:
        """Split the columns into one info per env."""
        for numbers, values in self._columns:
            for number, *row in zip(numbers, *values.values(), strict=True):
                self._infos[number] = dict(zip(values, row, strict=True))
        self._columns = []

    def _with_restart(self, number: int) -> dict[str, Any]:
        info, restart = self._infos[number], self.restarts.get(number)
        if restart is None:
            return info
        return {"final_obs": restart.final_observation, "final_info": info, **restart.info}


class SubEnv:
    """One env of a vector env, which writes its observations into a row of a batch.

    An env with a method `step_into(action, row)` is stepped by it, past the wrappers of `gym.make`:
    the clock of `TimeLimit` is counted here, and the others do nothing between two resets.

    A simulation has diverged when the env's info says so, when MuJoCo found a position, velocity or
    acceleration that is huge or not finite, or when an observation is not finite. MuJoCo then
    restarts from the model's own pose, which the action did not cause: the env is terminated, the
    reward is 0, and the info has `diverged`. Observations that are not finite read 0.

    Args:
        env: The env as `gym.make` makes it.
        row: Where to write its observations.

    Attributes:
        tuned: The env without its wrappers if its physics can be stepped separately, else None.
    """

    __slots__ = ("_clock", "_limit", "_step_into", "_warnings", "env", "row", "tuned")

    def __init__(self, env: gym.Env[Any, Any], row: NDArray[Any]) -> None:
        self.env = env
        self.row = row
        self._clock: Any = None
        self._limit = math.inf
        self._step_into: Any = None
        self._warnings: NDArray[Any] | None = None
        inner: Any = env
        while isinstance(inner, OrderEnforcing | PassiveEnvChecker | TimeLimit):
            if isinstance(inner, TimeLimit):
                self._clock = inner
                self._limit = cast("Any", inner)._max_episode_steps
            inner = cast("Any", inner).env
        if inner is env.unwrapped and row.dtype == np.float64:
            self._step_into = getattr(inner, "step_into", None)
        self.tuned: TunedStep | None = (
            cast("TunedStep", inner)
            if self._step_into is not None and hasattr(inner, "ready_together")
            else None
        )

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        """Start an episode, and return its info.

        Args:
            seed: Seed of the env; None to go on with its generator.
            options: Options of the env's reset.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        self.row[...] = observation
        if self._step_into is None:
            # A reset may have replaced the data.
            data = getattr(self.env.unwrapped, "data", None)
            self._warnings = None if data is None else data.warning.number[_BAD_STATE]
        return info

    def step(self, action: Any) -> Step:
        """Take one step."""
        if self._step_into is None:
            observation, reward, terminated, truncated, info = self.env.step(action)
            self.row[...] = observation
        else:
            reward, terminated, truncated, info = self._step_into(action, self.row)
            truncated = self.tick() or truncated
        if "diverged" in info or (self._warnings is not None and self._warnings.any()):
            return self.diverged(truncated, info)
        return reward, terminated, truncated, info

    def tick(self) -> bool:
        """Count one more step; return whether the episode's time limit is reached."""
        clock = self._clock
        if clock is None:
            return False
        clock._elapsed_steps += 1
        return clock._elapsed_steps >= self._limit

    def diverged(self, truncated: Any, info: dict[str, Any]) -> Step:
        """Return the result of a step whose simulation has diverged.

        Args:
            truncated: Whether the step was truncated.
            info: Info of the step.
        """
        self.row[~np.isfinite(self.row)] = 0.0
        return 0.0, True, truncated, {**info, "diverged": True}
