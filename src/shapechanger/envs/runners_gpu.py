"""Runners, swimmers and humanoids on a device."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import ClassVar, Final

import torch
from torch import Tensor
from typing_extensions import override

from shapechanger.envs.runners import (
    HalfCheetahEnv,
    HopperEnv,
    HumanoidEnv,
    SwimmerEnv,
    Walker2dEnv,
)
from shapechanger.envs.warp.reader import register_task
from shapechanger.envs.warp.tasks import DeviceTask, Outcome, cost, gymnasium_class_of
from shapechanger.envs.warp.worlds import Infos


class DeviceRunner(DeviceTask):
    """Runners and swimmers, which are always healthy if their CPU env has no healthy heights."""

    # Index of the trunk's height in `qpos`.
    height_at: ClassVar[int] = 1

    @override
    def observations(self) -> Tensor:
        env = self._env
        hidden = env.place_size if env._place_hidden else 0
        velocities = self.qvel.clamp(-env.velocity_limit, env.velocity_limit)
        return torch.cat([self.qpos[:, hidden:], velocities], dim=1)

    def _healthy(self) -> Tensor:
        """Return whether each body is healthy, shape (n,): within its heights, if it has limits."""
        height, constants = self.qpos[:, self.height_at], self.constants
        if "low" not in constants:
            return torch.ones_like(height, dtype=torch.bool)
        return (constants["low"] < height) & (height < constants["high"])

    def _contact_cost(self) -> Tensor | float:
        """Return the cost of contact forces, shape (n,), or 0 for a task that has none."""
        return 0.0

    @override
    def outcome(self, before: Tensor, actions: Tensor) -> Outcome:
        env = self._env
        velocity = (self.place() - before) / self.constants["dt"][:, None]
        healthy = self._healthy()
        # Attributes of the env that Gymnasium's formula reads.
        there = SimpleNamespace(
            _forward_reward_weight=env._forward_reward_weight,
            healthy_reward=healthy * getattr(env, "_healthy_reward", 0.0),
            control_cost=partial(cost, env._ctrl_cost_weight),
            contact_cost=self._contact_cost(),
        )
        rewards, terms = gymnasium_class_of(env)._get_rew(there, velocity[:, 0], actions)
        speeds = {f"{axis}_velocity": speed for axis, speed in zip("xy", velocity.T, strict=False)}
        ends = bool(getattr(env, "_terminate_when_unhealthy", False))
        infos = {**self.start_infos(), **speeds, **terms}
        return rewards, ~healthy & ends, infos


class DeviceCheetah(DeviceRunner):
    """Half cheetahs."""

    normal_velocities = True


class DeviceWalker(DeviceRunner):
    """Walkers, which are healthy within ranges of height and lean."""

    def _healthy(self) -> Tensor:
        lean = self.qpos[:, 2]
        low, high = self._env._healthy_angle_range
        return super()._healthy() & (low < lean) & (lean < high)

    @override
    def start_infos(self) -> Infos:
        risen = self.qpos[:, 1] - self.constants["init_qpos"][:, 1]
        return {**super().start_infos(), "z_distance_from_origin": risen}


class DeviceHopper(DeviceWalker):
    """Hoppers, which are healthy within ranges of height, lean and state."""

    def _healthy(self) -> Tensor:
        low, high = self._env._healthy_state_range
        state = torch.cat([self.qpos[:, 2:], self.qvel], dim=1)
        within = ((low < state) & (state < high)).all(dim=1)
        return super()._healthy() & within


# Blocks of numbers that a humanoid observes, and how many first rows (world or trunk) are omitted.
_BLOCKS: Final = {"cinert": 1, "cvel": 1, "qfrc_actuator": 6, "cfrc_ext": 1}


class DeviceHumanoid(DeviceRunner):
    """Humanoids, rewarded for the speed of the centre of mass and healthy within heights."""

    height_at = 2
    contact_forces = True
    start_forces = True

    @override
    def place(self) -> Tensor:
        mass = self.row("body_mass")
        return (mass[..., None] * self.xipos[..., :2]).sum(dim=1) / mass.sum(dim=1)[:, None]

    @override
    def observations(self) -> Tensor:
        blocks = [
            getattr(self, name)[:, first:].flatten(1)
            for name, first in _BLOCKS.items()
            if getattr(self._env, f"_include_{name}_in_observation") is True
        ]
        return torch.cat([super().observations(), *blocks], dim=1)

    def _contact_cost(self) -> Tensor:
        of_forces = cost(self._env._contact_cost_weight, self.cfrc_ext)
        return of_forces.clamp(*self._env._contact_cost_range)

    @override
    def start_infos(self) -> Infos:
        tendons = {"tendon_length": self.ten_length, "tendon_velocity": self.ten_velocity}
        return super().start_infos() | {name: each.clone() for name, each in tendons.items()}


register_task(HalfCheetahEnv, DeviceCheetah)
register_task(HopperEnv, DeviceHopper)
register_task(Walker2dEnv, DeviceWalker)
register_task(SwimmerEnv, DeviceRunner)
register_task(HumanoidEnv, DeviceHumanoid)
