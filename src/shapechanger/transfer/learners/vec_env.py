"""The parallel envs of a training with Stable-Baselines3."""

from __future__ import annotations

from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import needing_extra
from shapechanger.layout import Layout
from shapechanger.registry import MAKERS
from shapechanger.transfer.actions import ActionScale, learners_space, require_ranges

with needing_extra("learn"):
    from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper


class ThreadVecEnv(DummyVecEnv):
    """Envs of one id, stepped by threads, with results bitwise equal to `DummyVecEnv`.

    As in `DummyVecEnv`, an env whose episode has ended is reset in the same step. Its info then
    contains the last observation as `terminal_observation`. `TimeLimit.truncated` in every info is
    true if the episode was truncated and did not terminate. Rewards are float32. Other arguments
    are passed to `shapechanger.make_vec`.
    """

    def __init__(
        self, env_id: str, num_envs: int, *, threads: int | None = None, **arguments: Any
    ) -> None:
        self._envs = MAKERS.load("make_vec")(
            env_id,
            num_envs,
            backend="threads",
            threads=threads,
            autoreset_mode="SameStep",
            **arguments,
        )
        self.envs = self._envs.envs
        # Skips the constructor of DummyVecEnv, which would make its own envs and buffers.
        cast("Any", VecEnv).__init__(
            self, num_envs, self._envs.single_observation_space, self._envs.single_action_space
        )
        # DummyVecEnv, too, replaces the metadata that the constructor of VecEnv sets.
        self.metadata = self.envs[0].metadata

    def reset(self) -> NDArray[Any]:
        """Reset each env with the seeds and options set before."""
        options = [each or None for each in self._options]
        observations, self.reset_infos = self._envs.reset_each(self._seeds, options)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_wait(
        self,
    ) -> tuple[NDArray[Any], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step each env; return observations, rewards, dones and infos."""
        observations, results = self._envs.step_each(self.actions)
        infos = results.of_each()
        cut_off = results.truncated & ~results.terminated
        for info, cut in zip(infos, cut_off.tolist(), strict=True):
            info["TimeLimit.truncated"] = cut
        for i, (last, info) in results.restarts.items():
            infos[i]["terminal_observation"] = last
            self.reset_infos[i] = info
        ends = results.terminated | results.truncated
        return observations, results.rewards.astype(np.float32), ends, infos

    def close(self) -> None:
        """Close the envs; may be called twice."""
        self._envs.close()


class ScaledActions(VecEnvWrapper):
    """Wrapper that scales actions from -1 to 1 to the units of the envs' actuators."""

    def __init__(self, envs: VecEnv, scale: ActionScale) -> None:
        space = learners_space(cast("Any", envs).action_space)
        cast("Any", super()).__init__(envs, action_space=space)
        self._scale = scale

    def reset(self) -> Any:
        """Reset each env."""
        return self.venv.reset()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Start a step with actions from -1 to 1, shape (envs, n)."""
        self.venv.step_async(self._scale.to_env(actions))

    def step_wait(self) -> Any:
        """End the step; return observations, rewards, dones and infos."""
        return cast("Any", self.venv).step_wait()


def with_scaled_actions(envs: VecEnv, layout: Layout, name: str) -> VecEnv:
    """Return envs with actions from -1 to 1; the given envs if their actions already are."""
    space = cast("Any", envs).action_space
    require_ranges(name, space, layout)
    scale = ActionScale.between(learners_space(space), layout)
    return envs if scale.is_identity else ScaledActions(envs, scale)


def training_vec_env(env: EnvRef, num_envs: int, threads: int | None) -> VecEnv:
    """Make the parallel envs of a training, with actions in the units of their actuators.

    Shapechanger's envs are stepped by threads. Envs of other packages may share state, so they are
    stepped one after another.
    """
    spec = gym.registry.get(env.id.rpartition(":")[2])
    if spec is not None and str(spec.vector_entry_point).startswith("shapechanger."):
        return ThreadVecEnv(env.id, num_envs, threads=threads, **env.kwargs)
    return DummyVecEnv([env.make for _ in range(num_envs)])
