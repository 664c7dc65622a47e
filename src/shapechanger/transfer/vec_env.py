"""The envs that a learner steps together, as Stable-Baselines3 wants them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import shapechanger
from shapechanger.errors import MissingExtra
from shapechanger.transfer.env_ref import EnvRef

try:
    from stable_baselines3.common import env_util
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv
except ImportError as error:
    raise MissingExtra("stable-baselines3", "learn") from error

__all__ = ["ThreadVecEnv", "learner_envs", "the_only"]

_Indices = None | int | Iterable[int]


class ThreadVecEnv(VecEnv):
    """Envs of one id, stepped by threads, with the numbers of `DummyVecEnv` to the last bit.

    An env that has ended starts again in the same step. Its info then has the last observation as
    `terminal_observation`, every info says under `TimeLimit.truncated` whether the clock alone
    ended the episode, and rewards are of single precision: all as in `DummyVecEnv`.

    Args:
        env_id: A registered id.
        num_envs: How many envs.
        threads: As in `shapechanger.make_vec`.
        **arguments: All other arguments of `shapechanger.make_vec`.
    """

    def __init__(
        self, env_id: str, num_envs: int, *, threads: int | None = None, **arguments: Any
    ) -> None:
        self._envs = shapechanger.make_vec(
            env_id, num_envs, threads=threads, autoreset_mode="SameStep", **arguments
        )
        self._actions: Any = None
        cast("Any", super()).__init__(
            num_envs, self._envs.single_observation_space, self._envs.single_action_space
        )
        # As DummyVecEnv, which replaces what the base class has put together.
        self.metadata = self._envs.envs[0].metadata

    def reset(self) -> NDArray[Any]:
        """Start an episode in each env, with the seeds and options set before."""
        options = [each or None for each in self._options]
        observations, self.reset_infos = self._envs.reset_each(self._seeds, options)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Take one step in each env; observations, rewards, ends and infos."""
        observations, results = self._envs.step_each(self._actions)
        infos = results.of_each()
        cut_off = results.truncated & ~results.terminated
        for info, cut in zip(infos, cut_off.tolist(), strict=True):
            info["TimeLimit.truncated"] = cut
        for i, restart in results.restarts.items():
            infos[i]["terminal_observation"] = restart.final_observation
            self.reset_infos[i] = restart.info
        ends = results.terminated | results.truncated
        return observations, results.rewards.astype(np.float32), ends, infos

    def close(self) -> None:
        """Close the envs; twice is fine."""
        self._envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """One picture per env."""
        return self._envs.render()

    def get_attr(self, attr_name: str, indices: _Indices = None) -> list[Any]:
        """An attribute of each env, or of some."""
        return [env.get_wrapper_attr(attr_name) for env in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: _Indices = None) -> None:
        """Set an attribute of each env, or of some."""
        for env in self._chosen(indices):
            setattr(env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: _Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of each env, or of some."""
        return [
            env.get_wrapper_attr(method_name)(*method_args, **method_kwargs)
            for env in self._chosen(indices)
        ]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: _Indices = None
    ) -> list[bool]:
        """Whether each env, or some, are wrapped by a class."""
        return [env_util.is_wrapped(env, wrapper_class) for env in self._chosen(indices)]

    def _chosen(self, indices: _Indices) -> list[gym.Env[Any, Any]]:
        return [self._envs.envs[i] for i in self._get_indices(indices)]


def learner_envs(env: EnvRef, num_envs: int, threads: int | None) -> VecEnv:
    """The envs that a learner steps together.

    Envs of the catalogue are stepped by threads. Those of others may share what they change, so
    they are stepped one after another; the numbers would be the same.

    Args:
        env: The env.
        num_envs: How many.
        threads: As in `shapechanger.make_vec`.
    """
    spec = gym.registry.get(env.id.rpartition(":")[2])
    if spec is not None and str(spec.vector_entry_point).startswith("shapechanger."):
        return ThreadVecEnv(env.id, num_envs, threads=threads, **env.kwargs)
    return DummyVecEnv([env.make for _ in range(num_envs)])


def the_only(env: gym.Env[Any, Any]) -> VecEnv:
    """The one env there is, as Stable-Baselines3 wants it."""
    return DummyVecEnv([lambda: env])
