"""What came of one step of many envs."""

from __future__ import annotations

from collections.abc import Container
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.vector.infos import Columns, batched, in_columns
from shapechanger.envs.vector.member import Member, Step

__all__ = ["Restart", "Results"]


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
        self._columns: list[Columns] = []

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
        infos: Columns,
    ) -> None:
        """Take what came of the steps of the envs that `infos` are of."""
        everybody = len(infos.numbers) == self.rewards.size
        where = slice(None) if everybody else np.asarray(infos.numbers)
        self.rewards[where] = rewards
        self.terminated[where] = terminated
        self.truncated[where] = truncated
        self._columns.append(infos)

    def tell_diverged(self, number: int, member: Member) -> None:
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
        kept: list[Columns] = []
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
