"""Tasks as functions of the state of many worlds, with the constants of their CPU envs.

Rewards are computed by the CPU envs' own formulas on tensors where these do not read a simulation;
every weight and range is read from a CPU env.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar, Final, NamedTuple, cast

import gymnasium as gym
import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import override

from shapechanger.envs.ant import AntEnv, ExtendedAntEnv, is_upright
from shapechanger.envs.catalogue import CATALOGUE, FINGER_ENVS, NAMESPACE
from shapechanger.envs.humanoid import HumanoidEnv
from shapechanger.envs.pendulum import (
    CLIPPED_AT,
    FALLEN_M,
    FALLEN_RAD,
    InvertedDoublePendulumEnv,
    InvertedPendulumEnv,
)
from shapechanger.envs.runners import (
    HalfCheetahEnv,
    HopperEnv,
    SwimmerEnv,
    Walker2dEnv,
)
from shapechanger.envs.warp.starts import DeviceStarts, length
from shapechanger.envs.warp.worlds import Worlds
from shapechanger.errors import VectorEnvError

Constants = dict[str, Tensor]


class DeviceOutcome(NamedTuple):
    """What a step earns.

    Attributes:
        rewards: Shape (n,).
        terminated: Shape (n,).
        infos: Tensors of shape (n, ...).
    """

    rewards: Tensor
    terminated: Tensor
    infos: dict[str, Tensor]


class DeviceTask(ABC):
    """Start, action, observation, reward and end of a task in the worlds of one batch.

    Args:
        env: A CPU env of the task, with any body of the batch.

    Attributes:
        normal_velocities: Whether start velocities are drawn normally, else uniformly.
        precision: Type of the bodies' constants.
        contact_forces: Whether the task reads `cfrc_ext`.
        start_forces: Whether the first observation reads forces.
    """

    normal_velocities: ClassVar[bool] = False
    precision: ClassVar[torch.dtype] = torch.float32
    contact_forces: ClassVar[bool] = False
    start_forces: ClassVar[bool] = False

    def __init__(self, env: Any) -> None:
        self._env = env

    @staticmethod
    def constants(env: Any) -> dict[str, NDArray[Any]]:
        """Return the numbers of the task that depend on the body of a CPU env."""
        found = {**DeviceStarts.constants(env), "dt": np.array(env.dt)}
        if hasattr(env, "healthy_z_range"):
            low, high = env.healthy_z_range
            found |= {"low": np.array(low), "high": np.array(high)}
        return found

    def attach(self, model: mujoco.MjModel, worlds: Worlds) -> None:
        """Serve worlds from here on.

        Args:
            model: A body of the batch.
            worlds: The worlds.

        Raises:
            VectorEnvError: If they cannot start.
        """
        scale = float(self._env._reset_noise_scale)
        self._starts = DeviceStarts(model, worlds, scale, self.normal_velocities)

    def start(
        self, worlds: Worlds, constants: Constants, mask: Tensor, seeds: Tensor, episodes: Tensor
    ) -> None:
        """Put some worlds, whose state is clear, into start states.

        Args:
            worlds: The worlds.
            constants: Numbers of each world's body.
            mask: Which worlds, shape (n,).
            seeds: The seed of each world, shape (n,).
            episodes: How many episodes each world has begun, shape (n,).
        """
        qpos, qvel = self._starts.draw(constants, seeds, episodes)
        chosen = mask[:, None]
        worlds.qpos.copy_(torch.where(chosen, qpos, worlds.qpos))
        worlds.qvel.copy_(torch.where(chosen, qvel, worlds.qvel))
        self._starts.settle(mask, constants)

    def act(self, worlds: Worlds, constants: Constants, actions: Tensor) -> None:
        """Apply actions, shape (n, nu), and step the physics."""
        worlds.ctrl[:] = actions
        worlds.step()

    def place(self, worlds: Worlds) -> Tensor:
        """Return the state from before the physics that the reward needs (a view)."""
        return worlds.qpos[:, :0]

    @abstractmethod
    def observations(self, worlds: Worlds) -> Tensor:
        """Return the observations, shape (n, size)."""

    @abstractmethod
    def outcome(
        self, worlds: Worlds, before: Tensor, actions: Tensor, constants: Constants
    ) -> DeviceOutcome:
        """Return rewards, ends and infos of a step.

        Args:
            worlds: The worlds after the physics.
            before: What `place` returned before.
            actions: Shape (n, nu).
            constants: Numbers of each world's body.
        """

    def start_infos(self, worlds: Worlds, constants: Constants) -> dict[str, Tensor]:
        """Return the infos of a reset, tensors of shape (n, ...)."""
        return {}


def _place_infos(worlds: Worlds) -> dict[str, Tensor]:
    """Return the place of a trunk in the plane of the floor, m, as the infos of a reset."""
    place = worlds.qpos[:, :2]
    return {
        "x_position": place[:, 0].clone(),
        "y_position": place[:, 1].clone(),
        "distance_from_origin": length(place),
    }


def _cost(weight: float, numbers: Tensor) -> Tensor:
    return weight * numbers.square().flatten(1).sum(dim=1)


class DeviceAnt(DeviceTask):
    """Ants of any body."""

    normal_velocities = True
    contact_forces = True

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self._main = int(env.model.body(env.main_body).id)

    def place(self, worlds: Worlds) -> Tensor:
        """Return the place of the main body, m, shape (n, 2)."""
        return worlds.xpos[:, self._main, :2]

    def _forces(self, worlds: Worlds) -> Tensor:
        return worlds.cfrc_ext.clamp(*self._env._contact_force_range)

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        parts = [worlds.qpos[:, 2 if self._env.place_hidden else 0 :], worlds.qvel]
        if self._env.contacts_observed:
            parts.append(self._forces(worlds)[:, 1:].flatten(1))
        return torch.cat(parts, dim=1)

    @override
    def outcome(
        self, worlds: Worlds, before: Tensor, actions: Tensor, constants: Constants
    ) -> DeviceOutcome:
        env, qpos = self._env, worlds.qpos
        velocity = (self.place(worlds) - before) / constants["dt"][:, None]
        upright = is_upright(
            qpos[:, 2], qpos[:, 4], qpos[:, 5], constants["low"], constants["high"]
        )
        finite = qpos.isfinite().all(dim=1) & worlds.qvel.isfinite().all(dim=1)
        healthy = upright & finite
        rewards, infos = env._reward(
            self.start_infos(worlds, constants).values(),
            velocity.T,
            _cost(env._ctrl_cost_weight, actions),
            _cost(env._contact_cost_weight, self._forces(worlds)),
            healthy,
        )
        return DeviceOutcome(rewards, ~healthy & bool(env._terminate_when_unhealthy), infos)

    @override
    def start_infos(self, worlds: Worlds, constants: Constants) -> dict[str, Tensor]:
        return _place_infos(worlds)


class DevicePendulum(DeviceTask):
    """Inverted pendulums of any length."""

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        return torch.cat([worlds.qpos, worlds.qvel], dim=1)

    @override
    def outcome(
        self, worlds: Worlds, before: Tensor, actions: Tensor, constants: Constants
    ) -> DeviceOutcome:
        finite = self.observations(worlds).isfinite().all(dim=1)
        up = finite & (worlds.qpos[:, 1].abs() <= FALLEN_RAD)
        rewards = up.to(worlds.qpos.dtype)
        return DeviceOutcome(rewards, ~up, {"reward_survive": rewards.clone()})


class DeviceDoublePendulum(DeviceTask):
    """Inverted double pendulums of any length."""

    normal_velocities = True
    start_forces = True

    @override
    @staticmethod
    def constants(env: Any) -> dict[str, NDArray[Any]]:
        found = DeviceTask.constants(env)
        for name in ("foot_m", "length_m", "plain_foot_m", "plain_length_m"):
            found[name] = np.array(getattr(env, f"_{name}"))
        return found

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        qpos, clip = worlds.qpos, (-CLIPPED_AT, CLIPPED_AT)
        hinges = qpos[:, 1:]
        velocities, force = worlds.qvel.clamp(*clip), worlds.qfrc_constraint[:, :1].clamp(*clip)
        return torch.cat([qpos[:, :1], hinges.sin(), hinges.cos(), velocities, force], dim=1)

    @override
    def outcome(
        self, worlds: Worlds, before: Tensor, actions: Tensor, constants: Constants
    ) -> DeviceOutcome:
        env, tip = self._env, worlds.site_xpos[:, 0]
        part = tip[:, 2] - constants["foot_m"]
        height = part * (constants["plain_length_m"] / constants["length_m"])
        height = height + constants["plain_foot_m"]
        fallen = ~(height > FALLEN_M)  # Also true if the height is not a number.
        # Gymnasium's formula, without the bonus, which it adds by a condition.
        there = SimpleNamespace(
            data=SimpleNamespace(qvel=worlds.qvel.T), _healthy_reward=env._healthy_reward
        )
        rewards, infos = _base(env)._get_rew(there, tip[:, 0], height, True)
        bonus = env._healthy_reward * (~fallen).to(height.dtype)
        return DeviceOutcome(rewards + bonus, fallen, {**infos, "reward_survive": bonus})


class DeviceRunner(DeviceTask):
    """Runners that never end."""

    place_size: ClassVar[int] = 1

    def place(self, worlds: Worlds) -> Tensor:
        """Return the place of the trunk, m, shape (n, place_size)."""
        return worlds.qpos[:, : self.place_size]

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        env = self._env
        hidden = env.place_size if env._place_hidden else 0
        velocities = worlds.qvel.clamp(-env.velocity_limit, env.velocity_limit)
        return torch.cat([worlds.qpos[:, hidden:], velocities], dim=1)

    def healthy(self, worlds: Worlds, constants: Constants) -> Tensor:
        """Return whether each body is healthy, shape (n,)."""
        return torch.ones(worlds.count, dtype=torch.bool, device=worlds.qpos.device)

    def contact_cost(self, worlds: Worlds) -> Tensor | float:
        """Return the cost of contact forces, shape (n,), or 0 for a task that has none."""
        del worlds
        return 0.0

    @override
    def outcome(
        self, worlds: Worlds, before: Tensor, actions: Tensor, constants: Constants
    ) -> DeviceOutcome:
        env = self._env
        velocity = (self.place(worlds) - before) / constants["dt"][:, None]
        healthy = self.healthy(worlds, constants)
        # What Gymnasium's formula asks its env for.
        there = SimpleNamespace(
            _forward_reward_weight=env._forward_reward_weight,
            healthy_reward=healthy * getattr(env, "_healthy_reward", 0.0),
            control_cost=partial(_cost, env._ctrl_cost_weight),
            contact_cost=self.contact_cost(worlds),
        )
        rewards, terms = _base(env)._get_rew(there, velocity[:, 0], actions)
        infos = self.start_infos(worlds, constants)
        infos |= {
            f"{axis}_velocity": velocity[:, i] for i, axis in enumerate("xy"[: self.place_size])
        }
        ends = bool(getattr(env, "_terminate_when_unhealthy", False))
        return DeviceOutcome(rewards, ~healthy & ends, {**infos, **terms})

    @override
    def start_infos(self, worlds: Worlds, constants: Constants) -> dict[str, Tensor]:
        return {"x_position": worlds.qpos[:, 0].clone()}


class DeviceSwimmer(DeviceRunner):
    """Swimmers, which are rewarded for their place in a horizontal plane."""

    place_size = 2

    @override
    def start_infos(self, worlds: Worlds, constants: Constants) -> dict[str, Tensor]:
        return _place_infos(worlds)


class DeviceCheetah(DeviceRunner):
    """Half cheetahs."""

    normal_velocities = True


class DeviceWalker(DeviceRunner):
    """Walkers, which are healthy within heights and leans."""

    def healthy(self, worlds: Worlds, constants: Constants) -> Tensor:
        """Return whether each body is healthy, shape (n,)."""
        height, lean = worlds.qpos[:, 1], worlds.qpos[:, 2]
        low, high = self._env._healthy_angle_range
        upright = (low < lean) & (lean < high)
        return upright & (constants["low"] < height) & (height < constants["high"])

    @override
    def start_infos(self, worlds: Worlds, constants: Constants) -> dict[str, Tensor]:
        qpos, start = worlds.qpos, constants["init_qpos"]
        return {
            "x_position": qpos[:, 0].clone(),
            "z_distance_from_origin": qpos[:, 1] - start[:, 1],
        }


class DeviceHopper(DeviceWalker):
    """Hoppers, which are healthy within heights, leans and states."""

    def healthy(self, worlds: Worlds, constants: Constants) -> Tensor:
        """Return whether each body is healthy, shape (n,)."""
        low, high = self._env._healthy_state_range
        state = torch.cat([worlds.qpos[:, 2:], worlds.qvel], dim=1)
        within = ((low < state) & (state < high)).all(dim=1)
        return super().healthy(worlds, constants) & within


# Blocks of numbers that a humanoid observes, each without the world's or the trunk's first rows.
_BLOCKS: Final = {"cinert": 1, "cvel": 1, "qfrc_actuator": 6, "cfrc_ext": 1}


class DeviceHumanoid(DeviceRunner):
    """Humanoids, which are rewarded for the speed of their mass and healthy within heights."""

    place_size = 2
    contact_forces = True
    start_forces = True

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self._blocks = [
            (name, first)
            for name, first in _BLOCKS.items()
            if getattr(env, f"_include_{name}_in_observation") is True
        ]

    def place(self, worlds: Worlds) -> Tensor:
        """Return the place of the centre of mass, m, shape (n, 2)."""
        mass = worlds.row("body_mass")
        return (mass[..., None] * worlds.xipos[..., :2]).sum(dim=1) / mass.sum(dim=1)[:, None]

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        blocks = [getattr(worlds, name)[:, first:].flatten(1) for name, first in self._blocks]
        return torch.cat([super().observations(worlds), *blocks], dim=1)

    def healthy(self, worlds: Worlds, constants: Constants) -> Tensor:
        """Return whether each body is healthy, shape (n,)."""
        height = worlds.qpos[:, 2]
        return (constants["low"] < height) & (height < constants["high"])

    def contact_cost(self, worlds: Worlds) -> Tensor:
        """Return the cost of contact forces within the range of the task, shape (n,)."""
        env = self._env
        cost = _cost(env._contact_cost_weight, worlds.cfrc_ext)
        return cost.clamp(*env._contact_cost_range)

    @override
    def start_infos(self, worlds: Worlds, constants: Constants) -> dict[str, Tensor]:
        return {
            **_place_infos(worlds),
            "tendon_length": worlds.ten_length.clone(),
            "tendon_velocity": worlds.ten_velocity.clone(),
        }


_TASKS: Final[dict[type[Any], type[DeviceTask]]] = {
    AntEnv: DeviceAnt,
    ExtendedAntEnv: DeviceAnt,
    InvertedPendulumEnv: DevicePendulum,
    InvertedDoublePendulumEnv: DeviceDoublePendulum,
    HalfCheetahEnv: DeviceCheetah,
    HopperEnv: DeviceHopper,
    Walker2dEnv: DeviceWalker,
    SwimmerEnv: DeviceSwimmer,
    HumanoidEnv: DeviceHumanoid,
}


def find_device_task(env: gym.Env[Any, Any], env_id: str) -> type[DeviceTask]:
    """Return the batched functions of an env's task.

    Args:
        env: The CPU env; a subclass of ours may have changed the task, so it has none.
        env_id: Its id, for messages.

    Raises:
        VectorEnvError: If the task has no batched functions.
    """
    found = _TASKS.get(type(env.unwrapped))
    if found is None:
        known = [
            entry.name
            for entry in CATALOGUE.values()
            if entry.entry_point.rpartition(":")[2] in {kind.__name__ for kind in _TASKS}
        ]
        *own, last = (
            name.removeprefix(f"{NAMESPACE}/").removesuffix("-v1")
            for name, task in FINGER_ENVS.items()
            if task.device
        )
        raise VectorEnvError(
            f"{env_id} has no batched functions, which backend='warp' needs: those exist for "
            f"{', '.join((*known, *own))} and {last}."
        )
    return found


def _base(env: Any) -> Any:
    """Return Gymnasium's class of an env."""
    return cast(
        "Any", next(each for each in type(env).__mro__ if each.__module__.startswith("gymnasium."))
    )
