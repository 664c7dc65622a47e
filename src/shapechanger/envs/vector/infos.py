"""The infos of many envs as one dictionary of arrays, with a mask for each."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import TunedStep

__all__ = ["InfoColumns", "Restart", "Results", "Step", "SubEnv", "batched", "in_columns"]

# For each key one entry per env, and under the key with a `_` before it whether the env has one.
Batch = dict[str, Any]


class InfoColumns(NamedTuple):
    """The infos of envs that have the same keys.

    Attributes:
        numbers: The numbers of the envs, from the lowest up.
        values: For each key one value per env.
    """

    numbers: Sequence[int]
    values: Mapping[str, Sequence[Any] | NDArray[Any]]

    def only(self, places: Sequence[int]) -> InfoColumns:
        """The infos of the envs at these places."""
        if len(places) == len(self.numbers):
            return self
        return InfoColumns(
            [self.numbers[place] for place in places],
            {key: [column[place] for place in places] for key, column in self.values.items()},
        )

    def rows(self) -> list[dict[str, Any]]:
        """The info of each env."""
        return [
            dict(zip(self.values, row, strict=True))
            for row in zip(*self.values.values(), strict=True)
        ]


def in_columns(numbers: Sequence[int], infos: Sequence[Mapping[str, Any]]) -> list[InfoColumns]:
    """The infos of the envs `numbers`, with those together that have the same keys."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for place, info in enumerate(infos):
        groups.setdefault(tuple(info), []).append(place)
    return [
        InfoColumns(
            [numbers[place] for place in places],
            dict(zip(keys, zip(*(infos[i].values() for i in places), strict=True), strict=True)),
        )
        for keys, places in groups.items()
    ]


def batched(parts: Iterable[InfoColumns], num_envs: int) -> Batch:
    """The infos of all envs, as Gymnasium's vector envs give them.

    Gymnasium adds one env after another and each key by itself. Envs whose infos have the same keys
    are added together here, for a tenth of the time.

    Args:
        parts: The infos of the envs that have any.
        num_envs: How many envs there are.
    """
    batch: Batch = {}
    _extend(batch, parts, num_envs)
    return batch


def _extend(batch: Batch, parts: Iterable[InfoColumns], num_envs: int) -> None:
    """Add infos to arrays for `num_envs`, those of the lowest env first, as its types count."""
    for numbers, values in sorted(parts, key=lambda part: part.numbers[0]):
        where = slice(None) if len(numbers) == num_envs else np.asarray(numbers)
        masks = np.zeros((len(values), num_envs), np.bool_)
        masks[:, where] = True
        for (key, column), mask in zip(values.items(), masks, strict=True):
            batch[key] = _added(batch.get(key), key, column, numbers, where, num_envs)
            name = f"_{key}"
            batch[name] = batch[name] | mask if name in batch else mask


def _added(
    before: Any,
    key: str,
    values: Sequence[Any] | NDArray[Any],
    numbers: Sequence[int],
    where: slice | NDArray[np.intp],
    num_envs: int,
) -> NDArray[Any] | Batch:
    """What is under `key` once the values of the envs `numbers`, which are `where`, are in it."""
    first = values[0]
    if isinstance(first, dict) and key != "final_obs":
        inner: Batch = {} if before is None else before
        _extend(inner, in_columns(numbers, cast("Sequence[Any]", values)), num_envs)
        return inner
    if before is None and isinstance(values, np.ndarray) and values.size == num_envs:
        return np.array(values)
    if before is not None:
        array = before
    elif isinstance(values, np.ndarray):
        array = np.zeros(num_envs, values.dtype)
    else:
        array = _empty(None if key == "final_obs" else first, num_envs)
    if array.dtype == np.object_:  # Numbers and arrays in it stay what they are.
        for number, value in zip(numbers, values, strict=True):
            array[number] = value
    else:
        array[where] = values
    return array


def _empty(value: Any, num_envs: int) -> NDArray[Any]:
    """An array for values such as this."""
    if _has_an_array(value):
        return np.zeros(num_envs, np.asarray(value).dtype)
    if isinstance(value, np.ndarray):
        array = cast("NDArray[Any]", value)
        return np.zeros((num_envs, *array.shape), array.dtype)
    return np.full(num_envs, None, np.object_)


def _has_an_array(value: object) -> bool:
    """Whether values of this type get an array of it; NumPy's booleans do not."""
    return type(value) in (int, float, bool) or isinstance(value, np.number)


# Places of mjWARN_BADQPOS, mjWARN_BADQVEL and mjWARN_BADQACC among MuJoCo's warnings.
_BAD_QPOS: Final = 3
_BAD_QVEL: Final = 4
_BAD_QACC: Final = 5

# Reward, terminated, truncated and info.
Step = tuple[Any, Any, Any, dict[str, Any]]


class SubEnv:
    """An env that writes its observations into a row of a batch.

    An env with a method `step_into(action, row)` is stepped by it, past the wrappers of `gym.make`:
    the clock of `TimeLimit` goes on here, and the others have nothing to do between two resets.

    A simulation has diverged when the env's info says so, or MuJoCo found a position, velocity or
    acceleration that is not finite or is huge, or an observation is not finite. MuJoCo then goes on
    from the model's own pose, which is no result of the action: the env is terminated, the step is
    worth nothing, and its info has `diverged`. Numbers that are not finite read 0.

    Args:
        env: The env, as `gym.make` makes it.
        row: Where its observations go.

    Attributes:
        tuned: The env without its wrappers, if its physics may step apart; else None.
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
        # Steps its physics apart from what it makes of it.
        self.tuned: TunedStep | None = (
            cast("TunedStep", inner)
            if self._step_into is not None and hasattr(inner, "ready_together")
            else None
        )

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        """Start an episode, and return its info."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.row[...] = observation
        # A reset may have brought another body, and with it other data.
        if self._step_into is None:
            data = getattr(self.env.unwrapped, "data", None)
            self._warnings = None if data is None else data.warning.number
        return info

    def step(self, action: Any) -> Step:
        """Take one step; reward, terminated, truncated and info are as those of the env."""
        if self._step_into is None:
            observation, reward, terminated, truncated, info = self.env.step(action)
            self.row[...] = observation
        else:
            reward, terminated, truncated, info = self._step_into(action, self.row)
            truncated = self.ticked() or truncated
        if "diverged" in info or (self._warnings is not None and self._warned()):
            return self.diverged(truncated, info)
        return reward, terminated, truncated, info

    def ready(self) -> Any:
        """The binding of the env, if its physics may step apart; else `step` must do it all."""
        if self.tuned is None:
            return None
        return self.tuned.ready_together()

    def ticked(self) -> bool:
        """Count one more step; whether the time of the episode is over with it."""
        clock = self._clock
        if clock is None:
            return False
        clock._elapsed_steps += 1
        return clock._elapsed_steps >= self._limit

    def diverged(self, truncated: Any, info: dict[str, Any]) -> Step:
        """What a step is that no simulation stands behind."""
        self.row[~np.isfinite(self.row)] = 0.0
        return 0.0, True, truncated, {**info, "diverged": True}

    def _warned(self) -> bool:
        """Whether MuJoCo has found the simulation bad since the last reset."""
        counts = cast("NDArray[Any]", self._warnings)
        return bool(counts[_BAD_QPOS] or counts[_BAD_QVEL] or counts[_BAD_QACC])


class Restart(NamedTuple):
    """A reset that followed the end of an episode within the same step.

    Attributes:
        final_observation: The last observation of the episode.
        info: The info of the reset.
    """

    final_observation: NDArray[Any]
    info: dict[str, Any]


class Results:
    """What came of a step; threads may tell it of different envs at the same time.

    Infos of envs that are told of together stay columns until somebody asks for them one by one.

    Args:
        num_envs: How many envs there are.

    Attributes:
        rewards: What the step was worth to each, shape (n,).
        terminated: Whether it ended the episode of each, (n,).
        truncated: Whether the episode of each was cut off, (n,).
        restarts: By number the envs that started again at once.
    """

    def __init__(self, num_envs: int) -> None:
        self.rewards = np.zeros(num_envs, np.float64)
        self.terminated = np.zeros(num_envs, np.bool_)
        self.truncated = np.zeros(num_envs, np.bool_)
        self.restarts: dict[int, Restart] = {}
        self._single: dict[int, dict[str, Any]] = {}
        self._columns: list[InfoColumns] = []

    def tell(self, number: int, step: Step) -> None:
        """Take what came of the step of one env."""
        reward, terminated, truncated, info = step
        self.rewards[number] = reward
        self.terminated[number] = terminated
        self.truncated[number] = truncated
        self._single[number] = info

    def tell_together(
        self,
        rewards: NDArray[Any],
        terminated: NDArray[np.bool_],
        truncated: list[bool],
        infos: InfoColumns,
    ) -> None:
        """Take what came of the steps of the envs that `infos` are of."""
        everybody = len(infos.numbers) == self.rewards.size
        where = slice(None) if everybody else np.asarray(infos.numbers)
        self.rewards[where] = rewards
        self.terminated[where] = terminated
        self.truncated[where] = truncated
        self._columns.append(infos)

    def tell_diverged(self, number: int, member: SubEnv) -> None:
        """Take that the simulation of an env that has been told of has diverged."""
        self._take_apart((number,))
        cut_off = bool(self.truncated[number])
        self.tell(number, member.diverged(cut_off, self._single[number]))

    def of_each(self) -> list[dict[str, Any]]:
        """The info of each env."""
        everybody = range(self.rewards.size)
        self._take_apart(everybody)
        return [self._single[number] for number in everybody]

    def batched(self) -> dict[str, Any]:
        """All infos as Gymnasium's vector envs give them, with those of restarts."""
        self._take_apart(self.restarts)
        numbers = sorted(self._single)
        infos = [self._with_restart(number) for number in numbers]
        return batched([*self._columns, *in_columns(numbers, infos)], self.rewards.size)

    def _with_restart(self, number: int) -> dict[str, Any]:
        info, restart = self._single[number], self.restarts.get(number)
        if restart is None:
            return info
        return {"final_obs": restart.final_observation, "final_info": info, **restart.info}

    def _take_apart(self, chosen: Container[int]) -> None:
        """Take the infos of some envs out of the columns."""
        kept: list[InfoColumns] = []
        for columns in self._columns:
            apart = [place for place, number in enumerate(columns.numbers) if number in chosen]
            if not apart:
                kept.append(columns)
                continue
            out = columns.only(apart)
            self._single.update(zip(out.numbers, out.rows(), strict=True))
            left = sorted({*range(len(columns.numbers))} - {*apart})
            if left:
                kept.append(columns.only(left))
        self._columns = kept
