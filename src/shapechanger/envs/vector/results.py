"""One env of a vector env, and the results of a step of all its envs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import TunedStep

# Indices of mjWARN_BADQPOS, mjWARN_BADQVEL and mjWARN_BADQACC in `data.warning`.
_BAD_STATE: Final = slice(3, 6)

Step = tuple[Any, Any, Any, dict[str, Any]]
"""Reward, terminated, truncated and info of one env."""


class InfoColumns(NamedTuple):
    """Infos of envs that have the same keys, and no nested infos."""

    numbers: Sequence[int]
    """The numbers of the envs, ascending."""
    values: Mapping[str, Sequence[Any] | NDArray[Any]]
    """One value per env for each key."""


def in_columns(infos: Mapping[int, Mapping[str, Any]]) -> list[InfoColumns]:
    """Group infos, keyed by the number of the env; infos with nested ones are not grouped."""
    groups: dict[Any, list[int]] = {}
    for number, info in infos.items():
        nested = any(isinstance(value, dict) for value in info.values())
        groups.setdefault(number if nested else tuple(info), []).append(number)
    return [
        InfoColumns(numbers, {key: [infos[i][key] for i in numbers] for key in infos[numbers[0]]})
        for numbers in groups.values()
    ]


def batched(envs: VectorEnv[Any, Any, Any], parts: Iterable[InfoColumns]) -> dict[str, Any]:
    """Return the infos of all envs as Gymnasium's vector envs do.

    For each key there is an array of one entry per env, and under `_key` a mask of the envs with an
    entry. Gymnasium's method adds one env after another. Here it adds only the first env of each
    part, which makes the arrays; the others are added together.
    """
    batch: dict[str, Any] = {}
    add: Any = cast("Any", envs)._add_info
    # The lowest env first, as it sets the dtypes.
    for numbers, values in sorted(parts, key=lambda part: part.numbers[0]):
        add(batch, {key: column[0] for key, column in values.items()}, numbers[0])
        if len(numbers) == 1:
            continue
        others = slice(1, None) if len(numbers) == envs.num_envs else np.asarray(numbers[1:])
        for key, column in values.items():
            array = batch[key]
            if array.dtype == np.object_:  # Object arrays keep the types of their elements.
                for number, value in zip(numbers, column, strict=True):
                    array[number] = value
            else:
                array[others] = column[1:]
            batch[f"_{key}"][others] = True
    return batch


class StepResults:
    """Results of one step of all envs; threads may fill in different envs at the same time.

    Infos in columns stay in columns until `of_each` splits them by env.

    Attributes:
        rewards: Shape (n,).
        terminated: Whether the step ended each episode, shape (n,).
        truncated: Whether each episode was cut off, shape (n,).
        restarts: Last observation of the episode and info of the reset, for envs that were reset
            within the step, keyed by number.
    """

    def __init__(self, num_envs: int) -> None:
        self.rewards = np.zeros(num_envs, np.float64)
        self.terminated = np.zeros(num_envs, np.bool_)
        self.truncated = np.zeros(num_envs, np.bool_)
        self.restarts: dict[int, tuple[NDArray[Any], dict[str, Any]]] = {}
        self._infos: dict[int, dict[str, Any]] = {}
        self._columns: list[InfoColumns] = []

    def put(self, number: int, step: Step) -> None:
        """Set the result of one env."""
        self.rewards[number], self.terminated[number], self.truncated[number], info = step
        self._infos[number] = info

    def put_columns(
        self, numbers: Sequence[int], rewards: Any, terminated: Any, truncated: Any, infos: Any
    ) -> None:
        """Set the results of several envs from arrays, and their infos from columns."""
        where: Any = slice(None) if len(numbers) == self.rewards.size else numbers
        self.rewards[where], self.terminated[where] = rewards, terminated
        self.truncated[where] = truncated
        self._columns.append(InfoColumns(numbers, infos))

    def of_each(self) -> list[dict[str, Any]]:
        """Return the info of each env."""
        for numbers, values in self._columns:
            for number, *row in zip(numbers, *values.values(), strict=True):
                self._infos[number] = dict(zip(values, row, strict=True))
        self._columns = []
        return [self._infos[number] for number in range(self.rewards.size)]

    def batched(self, envs: VectorEnv[Any, Any, Any]) -> dict[str, Any]:
        """Return all infos as Gymnasium's vector envs do, including the infos of restarts."""
        if self.restarts:
            self.of_each()
        infos = {number: self._infos[number] for number in sorted(self._infos)}
        for number, (last, info) in self.restarts.items():
            infos[number] = {"final_obs": last, "final_info": infos[number], **info}
        return batched(envs, [*self._columns, *in_columns(infos)])


class SubEnv:
    """One env of a vector env, which writes its observations into a row of a batch.

    A simulation has diverged if the env's info has `diverged`, if MuJoCo found a position, velocity
    or acceleration that is huge or not finite, or if an observation is not finite. The env is then
    terminated, the reward is 0, and the info has `diverged`. Numbers of the observation that are
    not finite are replaced by 0.

    Attributes:
        tuned: The env without its time limit if its physics can be stepped separately, else None.
    """

    __slots__ = ("_clock", "_warnings", "env", "row", "tuned")

    def __init__(self, env: gym.Env[Any, Any], row: NDArray[Any]) -> None:
        self.env = env
        self.row = row
        self._clock: Any = env if isinstance(env, TimeLimit) else None
        self._warnings: NDArray[Any] | None = None
        inner: Any = env if self._clock is None else self._clock.env
        together = inner is env.unwrapped and hasattr(inner, "ready_together")
        self.tuned: TunedStep | None = (
            cast("TunedStep", inner) if together and row.dtype == np.float64 else None
        )

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        """Start an episode, and return its info; see `gymnasium.Env.reset`."""
        self.row[...], info = self.env.reset(seed=seed, options=options)
        inner: Any = self.env.unwrapped
        if hasattr(inner, "data"):  # A reset may have replaced `data`.
            self._warnings = inner.data.warning.number[_BAD_STATE]
        return info

    def step(self, action: Any) -> Step:
        """Take one step."""
        self.row[...], reward, terminated, truncated, info = self.env.step(action)
        if "diverged" in info or (self._warnings is not None and self._warnings.any()):
            return self.diverged(truncated, info)
        return cast("Any", reward), terminated, truncated, info

    def tick(self) -> bool:
        """Count one more step; return whether the episode's time limit is reached."""
        if self._clock is None:
            return False
        self._clock._elapsed_steps += 1
        return self._clock._elapsed_steps >= self._clock._max_episode_steps

    def diverged(self, truncated: Any, info: dict[str, Any]) -> Step:
        """Return the result of a step whose simulation has diverged."""
        self.row[~np.isfinite(self.row)] = 0.0
        return 0.0, True, truncated, {**info, "diverged": True}
