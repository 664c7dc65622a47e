"""One env of a vector env: its row, its clock, and whether its simulation still holds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapechanger.envs.stepping.tuned import TunedStep

__all__ = ["Member", "Step"]

# Places of mjWARN_BADQPOS, mjWARN_BADQVEL and mjWARN_BADQACC among MuJoCo's warnings.
_BAD_QPOS: Final = 3
_BAD_QVEL: Final = 4
_BAD_QACC: Final = 5

# Reward, terminated, truncated and info.
Step = tuple[Any, Any, Any, dict[str, Any]]


class Member:
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
