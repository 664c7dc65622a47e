"""Inverted pendulums, single and double, on a device."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import override

from shapechanger.envs.pendulum import (
    CLIPPED_AT,
    FALLEN_M,
    FALLEN_RAD,
    InvertedDoublePendulumEnv,
    InvertedPendulumEnv,
)
from shapechanger.envs.warp.reader import register_task
from shapechanger.envs.warp.tasks import DeviceTask, Outcome, gymnasium_class_of


class DevicePendulum(DeviceTask):
    """Inverted pendulums of any length."""

    @override
    def observations(self) -> Tensor:
        return torch.cat([self.qpos, self.qvel], dim=1)

    @override
    def outcome(self, before: Tensor, actions: Tensor) -> Outcome:
        finite = self.observations().isfinite().all(dim=1)
        up = finite & (self.qpos[:, 1].abs() <= FALLEN_RAD)
        rewards = up.to(self.qpos.dtype)
        return rewards, ~up, {"reward_survive": rewards.clone()}


class DeviceDoublePendulum(DeviceTask):
    """Inverted double pendulums of any length."""

    normal_velocities = True
    start_forces = True

    @override
    @staticmethod
    def constants_of(env: Any) -> dict[str, NDArray[Any]]:
        found = DeviceTask.constants_of(env)
        for name in ("foot_m", "length_m", "plain_foot_m", "plain_length_m"):
            found[name] = np.array(getattr(env, f"_{name}"))
        return found

    @override
    def observations(self) -> Tensor:
        qpos, clip = self.qpos, (-CLIPPED_AT, CLIPPED_AT)
        hinges = qpos[:, 1:]
        velocities, force = self.qvel.clamp(*clip), self.qfrc_constraint[:, :1].clamp(*clip)
        return torch.cat([qpos[:, :1], hinges.sin(), hinges.cos(), velocities, force], dim=1)

    @override
    def outcome(self, before: Tensor, actions: Tensor) -> Outcome:
        env, tip = self._env, self.site_xpos[:, 0]
        constants = self.constants
        part = tip[:, 2] - constants["foot_m"]
        height = part * (constants["plain_length_m"] / constants["length_m"])
        height = height + constants["plain_foot_m"]
        fallen = ~(height > FALLEN_M)  # Also true if the height is not a number.
        # Call Gymnasium's formula without the bonus, which depends on a condition.
        there = SimpleNamespace(
            data=SimpleNamespace(qvel=self.qvel.T), _healthy_reward=env._healthy_reward
        )
        rewards, infos = gymnasium_class_of(env)._get_rew(there, tip[:, 0], height, True)
        bonus = env._healthy_reward * (~fallen).to(height.dtype)
        return rewards + bonus, fallen, {**infos, "reward_survive": bonus}


register_task(InvertedPendulumEnv, DevicePendulum)
register_task(InvertedDoublePendulumEnv, DeviceDoublePendulum)
