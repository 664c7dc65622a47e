"""Reaching the envs of a vector env one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from shapechanger.errors import VectorEnvError

__all__ = ["Access"]


class Access(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """What a vector env passes on to its envs, as Gymnasium's `SyncVectorEnv` does.

    Attributes:
        envs: The envs.
    """

    envs: list[gym.Env[Any, Any]]
    observation_space: gym.Space[Any]
    action_space: gym.Space[Any]
    single_observation_space: gym.Space[Any]
    single_action_space: gym.Space[Any]

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The seed of each env's generator."""
        return self.get_attr("np_random_seed")

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Each env's generator."""
        return self.get_attr("np_random")

    def render(self) -> tuple[Any, ...]:
        """One frame per env."""
        self._require_open()
        return self._of_each(lambda i: cast("Any", self.envs[i]).render())

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of each env, or read an attribute.

        Args:
            name: Its name.
            *args: Arguments of the method.
            **kwargs: Named arguments of the method.
        """

        def ask(i: int) -> Any:
            found = self.envs[i].get_wrapper_attr(name)
            return found(*args, **kwargs) if callable(found) else found

        return self._of_each(ask)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each env."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each env.

        Args:
            name: Its name.
            values: A list or tuple with one value per env, or one value for all.

        Raises:
            VectorEnvError: If there are not as many values as envs.
        """
        each = cast("Sequence[Any]", values) if isinstance(values, list | tuple) else None
        if each is not None and len(each) != self.num_envs:
            raise VectorEnvError(f"There are {self.num_envs} envs and {len(each)} values.")
        self._of_each(
            lambda i: self.envs[i].set_wrapper_attr(name, values if each is None else each[i])
        )

    def _of_each(self, work: Callable[[int], Any]) -> tuple[Any, ...]:
        """What `work` gives for the number of each env, where that env is at home."""
        raise NotImplementedError

    def _require_open(self) -> None:
        """Refuse to go on after `close`.

        Raises:
            ClosedEnvironmentError: If there is nothing to go on with.
        """
        if self.closed:
            raise gym.error.ClosedEnvironmentError("This vector env is closed: make another one.")
