"""Ants of any body on a device."""

from __future__ import annotations

import torch
from torch import Tensor
from typing_extensions import override

from shapechanger.envs.ant import AntEnv, ExtendedAntEnv, is_upright
from shapechanger.envs.warp.reader import register_task
from shapechanger.envs.warp.tasks import DeviceTask, Outcome, cost


class DeviceAnt(DeviceTask):
    """Ants of any body."""

    normal_velocities = True
    contact_forces = True
    place_size = 2

    @override
    def place(self) -> Tensor:
        return self.xpos[:, int(self.model.body(self._env.main_body).id), :2]

    def _forces(self) -> Tensor:
        return self.cfrc_ext.clamp(*self._env._contact_force_range)

    @override
    def observations(self) -> Tensor:
        parts = [self.qpos[:, 2 if self._env.place_hidden else 0 :], self.qvel]
        if self._env.contacts_observed:
            parts.append(self._forces()[:, 1:].flatten(1))
        return torch.cat(parts, dim=1)

    @override
    def outcome(self, before: Tensor, actions: Tensor) -> Outcome:
        env, qpos, constants = self._env, self.qpos, self.constants
        velocity = (self.place() - before) / constants["dt"][:, None]
        limits = constants["low"], constants["high"]
        healthy = is_upright(qpos[:, 2], qpos[:, 4], qpos[:, 5], *limits)
        healthy &= qpos.isfinite().all(dim=1) & self.qvel.isfinite().all(dim=1)
        effort = cost(env._ctrl_cost_weight, actions)
        contact = cost(env._contact_cost_weight, self._forces())
        place = self.start_infos().values()
        rewards, infos = env._reward(place, velocity.T, effort, contact, healthy)
        return rewards, ~healthy & bool(env._terminate_when_unhealthy), infos


for _env_class in (AntEnv, ExtendedAntEnv):
    register_task(_env_class, DeviceAnt)
