"""Tasks as functions of the state of many worlds, with the constants of their CPU envs.

Rewards are computed by the CPU envs' own formulas on tensors where these do not read a simulation;
every weight and range is read from a CPU env.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar, Final

import gymnasium as gym
import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import override

from shapechanger.envs.ant import AntEnv, ExtendedAntEnv, is_upright
from shapechanger.envs.humanoid import HumanoidEnv
from shapechanger.envs.pendulum import (
    CLIPPED_AT,
    FALLEN_M,
    FALLEN_RAD,
    InvertedDoublePendulumEnv,
    InvertedPendulumEnv,
)
from shapechanger.envs.runners import HalfCheetahEnv, HopperEnv, SwimmerEnv, Walker2dEnv
from shapechanger.envs.warp.bodies import geom_type
from shapechanger.envs.warp.kernels import uniforms
from shapechanger.envs.warp.worlds import DeviceOutcome, Worlds
from shapechanger.errors import VectorEnvError
from shapechanger.layout import Layout
from shapechanger.morphology.pose import StartRules

_SHAPES: Final = ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
# Slice of the quaternion in the numbers of a joint.
_QUATERNION_AT: Final = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
# Streams of random numbers.
_POSITIONS: Final = 0
_VELOCITIES: Final = 1


class DeviceTask(ABC):
    """Start, action, observation, reward and end of a task in the worlds of one batch.

    Starts follow `StartRules`: noise around each body's pose, made feasible.

    Args:
        env: A CPU env of the task, with any body of the batch.
        model: Its compiled model.
        frame_skip: Physics steps of each `Worlds.simulate`.

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

    def __init__(self, env: Any, model: mujoco.MjModel, frame_skip: int) -> None:
        self._env = env
        self.model, self.frame_skip = model, frame_skip
        self.observation_layout: Layout = env.observation_layout
        self.action_layout: Layout = env.action_layout
        self.action_space: gym.spaces.Box = env.action_space

    @staticmethod
    def constants(env: Any) -> dict[str, NDArray[Any]]:
        """Return the numbers of the task that depend on the body of a CPU env."""
        rules = StartRules(env.model)
        found = {"init_qpos": env.init_qpos, "init_qvel": env.init_qvel, "dt": env.dt}
        found |= {"lowest": rules.lowest, "highest": rules.highest}
        if hasattr(env, "healthy_z_range"):
            found["low"], found["high"] = env.healthy_z_range
        return {name: np.array(value) for name, value in found.items()}

    def attach(self, worlds: Worlds) -> None:
        """Serve worlds from here on.

        Raises:
            VectorEnvError: If the body starts above a geom that is not a plane, or a geom that can
                touch the floor has a shape without a batched clearance.
        """
        model, rules = self.model, StartRules(self.model)
        self._limited = torch.as_tensor(rules.limited_places, device=worlds.device)
        self._quaternions = [
            int(address) + _QUATERNION_AT[kind]
            for address, kind in zip(model.jnt_qposadr, model.jnt_type.tolist(), strict=True)
            if kind in _QUATERNION_AT
        ]
        self._lift = rules.lift
        # Each floor with geoms of one shape.
        touching: dict[tuple[int, str], list[int]] = {}
        for floor, geom in rules.floor_pairs if rules.lift is not None else ():
            below, shape = geom_type(model, floor), geom_type(model, geom)
            if below != "PLANE" or shape not in _SHAPES:
                raise VectorEnvError(
                    "Bodies of backend='warp' start above planes, with spheres, capsules, "
                    f"ellipsoids, cylinders and boxes; here a {below} meets a {shape}."
                )
            touching.setdefault((floor, shape), []).append(geom)
        self._touching = {
            pair: torch.tensor(geoms, device=worlds.device) for pair, geoms in touching.items()
        }

    def start(self, worlds: Worlds, mask: Tensor, seeds: Tensor, episodes: Tensor) -> None:
        """Put the worlds of a mask, whose state has been cleared, into start states.

        Joints are moved inside their limits, orientations normalised, and a trunk whose feet are in
        the floor is lifted. For the arguments see `Worlds.start`.
        """
        constants, scale = worlds.constants, float(self._env._reset_noise_scale)
        qpos, qvel = constants["init_qpos"], constants["init_qvel"]
        moved = 2.0 * uniforms(seeds, episodes, _POSITIONS, qpos.shape[1]) - 1.0
        drawn = seeds, episodes, _VELOCITIES, qvel.shape[1]
        pushed = uniforms(*drawn, normal=self.normal_velocities)
        if not self.normal_velocities:
            pushed = 2.0 * pushed - 1.0
        qpos, qvel = qpos + (scale * moved).to(qpos.dtype), qvel + (scale * pushed).to(qvel.dtype)
        limits = constants["lowest"], constants["highest"]
        qpos[:, self._limited] = qpos[:, self._limited].clamp(*limits)
        for place in self._quaternions:
            part = slice(place, place + 4)
            qpos[:, part] = torch.nn.functional.normalize(qpos[:, part], dim=1)
        worlds.qpos.copy_(torch.where(mask[:, None], qpos, worlds.qpos))
        worlds.qvel.copy_(torch.where(mask[:, None], qvel, worlds.qvel))
        if self._lift is not None:
            worlds.kinematics()
            lack = (-self._clearance(worlds)).clamp_min(0.0).masked_fill(~mask, 0.0)
            worlds.qpos[:, self._lift.place] += self._lift.up * lack

    def _clearance(self, worlds: Worlds) -> Tensor:
        """Return how far each body's lowest point is above the floor, m, shape (n,)."""
        gap = worlds.qpos.new_full((worlds.count,), torch.inf)
        for (floor, shape), geoms in self._touching.items():
            up = worlds.geom_xmat[:, floor, :, 2]
            above = worlds.geom_xpos[:, geoms] - worlds.geom_xpos[:, floor, None]
            height = torch.einsum("ngi,ni->ng", above, up)
            # The plane's normal as each geom sees it.
            seen = torch.einsum("ngij,ni->ngj", worlds.geom_xmat[:, geoms], up)
            reach = _reach(shape, worlds.row("geom_size")[:, geoms], seen)
            gap = torch.minimum(gap, (height - reach).amin(dim=1))
        return gap

    def act(self, worlds: Worlds, actions: Tensor) -> None:
        """Apply actions, shape (n, nu), and step the physics."""
        worlds.ctrl[:] = actions
        worlds.simulate()

    def place(self, worlds: Worlds) -> Tensor:
        """Return the part of the state before the physics that the reward needs (a view)."""
        return worlds.qpos[:, :0]

    @abstractmethod
    def observations(self, worlds: Worlds) -> Tensor:
        """Return the observations, shape (n, size)."""

    @abstractmethod
    def outcome(self, worlds: Worlds, before: Tensor, actions: Tensor) -> DeviceOutcome:
        """Return rewards, ends and infos of a step.

        Args:
            worlds: The worlds after the physics.
            before: Result of `place` before the physics.
            actions: Shape (n, nu).
        """

    def start_infos(self, worlds: Worlds) -> dict[str, Tensor]:
        """Return the infos of a reset, tensors of shape (n, ...)."""
        return {}


def length(vectors: Tensor) -> Tensor:
    """Return the lengths of vectors, shape (..., k), as shape (...)."""
    return vectors.square().sum(dim=-1).sqrt()


def _reach(shape: str, size: Tensor, towards: Tensor) -> Tensor:
    """Return how far geoms of one shape reach from their middle in a direction, m, shape (n, k).

    The sizes, shape (n or 1, k, 3), are MuJoCo's, m; the direction, shape (n, k, 3), is in each
    geom's own axes.
    """
    radius, half = size[..., 0], size[..., 1]
    if shape == "SPHERE":
        return radius.expand(towards.shape[:2])
    if shape == "CAPSULE":
        return radius + half * towards[..., 2].abs()
    if shape == "ELLIPSOID":
        return length(size * towards)
    if shape == "CYLINDER":
        return radius * length(towards[..., :2]) + half * towards[..., 2].abs()
    return (size * towards.abs()).sum(dim=-1)


def _place_infos(worlds: Worlds) -> dict[str, Tensor]:
    """Return the position of a trunk in the plane of the floor, m, for the infos of a reset."""
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

    def place(self, worlds: Worlds) -> Tensor:
        """Return the place of the main body, m, shape (n, 2)."""
        return worlds.xpos[:, int(self.model.body(self._env.main_body).id), :2]

    def _forces(self, worlds: Worlds) -> Tensor:
        return worlds.cfrc_ext.clamp(*self._env._contact_force_range)

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        parts = [worlds.qpos[:, 2 if self._env.place_hidden else 0 :], worlds.qvel]
        if self._env.contacts_observed:
            parts.append(self._forces(worlds)[:, 1:].flatten(1))
        return torch.cat(parts, dim=1)

    @override
    def outcome(self, worlds: Worlds, before: Tensor, actions: Tensor) -> DeviceOutcome:
        env, qpos, constants = self._env, worlds.qpos, worlds.constants
        velocity = (self.place(worlds) - before) / constants["dt"][:, None]
        limits = constants["low"], constants["high"]
        healthy = is_upright(qpos[:, 2], qpos[:, 4], qpos[:, 5], *limits)
        healthy &= qpos.isfinite().all(dim=1) & worlds.qvel.isfinite().all(dim=1)
        costs = (
            _cost(env._ctrl_cost_weight, actions),
            _cost(env._contact_cost_weight, self._forces(worlds)),
        )
        place = self.start_infos(worlds).values()
        rewards, infos = env._reward(place, velocity.T, *costs, healthy)
        return DeviceOutcome(rewards, ~healthy & bool(env._terminate_when_unhealthy), infos)

    @override
    def start_infos(self, worlds: Worlds) -> dict[str, Tensor]:
        return _place_infos(worlds)


class DevicePendulum(DeviceTask):
    """Inverted pendulums of any length."""

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        return torch.cat([worlds.qpos, worlds.qvel], dim=1)

    @override
    def outcome(self, worlds: Worlds, before: Tensor, actions: Tensor) -> DeviceOutcome:
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
    def outcome(self, worlds: Worlds, before: Tensor, actions: Tensor) -> DeviceOutcome:
        env, tip = self._env, worlds.site_xpos[:, 0]
        constants = worlds.constants
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
    # Where the height of the trunk is in `qpos`.
    height_at: ClassVar[int] = 1

    def place(self, worlds: Worlds) -> Tensor:
        """Return the place of the trunk, m, shape (n, place_size)."""
        return worlds.qpos[:, : self.place_size]

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        env = self._env
        hidden = env.place_size if env._place_hidden else 0
        velocities = worlds.qvel.clamp(-env.velocity_limit, env.velocity_limit)
        return torch.cat([worlds.qpos[:, hidden:], velocities], dim=1)

    def _healthy(self, worlds: Worlds) -> Tensor:
        """Return whether each body is healthy, within heights where it has any, shape (n,)."""
        height, constants = worlds.qpos[:, self.height_at], worlds.constants
        if "low" not in constants:
            return torch.ones_like(height, dtype=torch.bool)
        return (constants["low"] < height) & (height < constants["high"])

    def _contact_cost(self, worlds: Worlds) -> Tensor | float:
        """Return the cost of contact forces, shape (n,), or 0 for a task that has none."""
        return 0.0

    @override
    def outcome(self, worlds: Worlds, before: Tensor, actions: Tensor) -> DeviceOutcome:
        env = self._env
        velocity = (self.place(worlds) - before) / worlds.constants["dt"][:, None]
        healthy = self._healthy(worlds)
        # Attributes of the env that Gymnasium's formula reads.
        there = SimpleNamespace(
            _forward_reward_weight=env._forward_reward_weight,
            healthy_reward=healthy * getattr(env, "_healthy_reward", 0.0),
            control_cost=partial(_cost, env._ctrl_cost_weight),
            contact_cost=self._contact_cost(worlds),
        )
        rewards, terms = _base(env)._get_rew(there, velocity[:, 0], actions)
        speeds = {f"{axis}_velocity": speed for axis, speed in zip("xy", velocity.T, strict=False)}
        ends = bool(getattr(env, "_terminate_when_unhealthy", False))
        infos = {**self.start_infos(worlds), **speeds, **terms}
        return DeviceOutcome(rewards, ~healthy & ends, infos)

    @override
    def start_infos(self, worlds: Worlds) -> dict[str, Tensor]:
        return {"x_position": worlds.qpos[:, 0].clone()}


class DeviceSwimmer(DeviceRunner):
    """Swimmers, which are rewarded for their place in a horizontal plane."""

    place_size = 2

    @override
    def start_infos(self, worlds: Worlds) -> dict[str, Tensor]:
        return _place_infos(worlds)


class DeviceCheetah(DeviceRunner):
    """Half cheetahs."""

    normal_velocities = True


class DeviceWalker(DeviceRunner):
    """Walkers, which are healthy within heights and leans."""

    def _healthy(self, worlds: Worlds) -> Tensor:
        lean = worlds.qpos[:, 2]
        low, high = self._env._healthy_angle_range
        return super()._healthy(worlds) & (low < lean) & (lean < high)

    @override
    def start_infos(self, worlds: Worlds) -> dict[str, Tensor]:
        qpos, start = worlds.qpos, worlds.constants["init_qpos"]
        return {
            "x_position": qpos[:, 0].clone(),
            "z_distance_from_origin": qpos[:, 1] - start[:, 1],
        }


class DeviceHopper(DeviceWalker):
    """Hoppers, which are healthy within heights, leans and states."""

    def _healthy(self, worlds: Worlds) -> Tensor:
        low, high = self._env._healthy_state_range
        state = torch.cat([worlds.qpos[:, 2:], worlds.qvel], dim=1)
        within = ((low < state) & (state < high)).all(dim=1)
        return super()._healthy(worlds) & within


# Blocks of numbers that a humanoid observes, each without the world's or the trunk's first rows.
_BLOCKS: Final = {"cinert": 1, "cvel": 1, "qfrc_actuator": 6, "cfrc_ext": 1}


class DeviceHumanoid(DeviceRunner):
    """Humanoids, which are rewarded for the speed of their mass and healthy within heights."""

    place_size = height_at = 2
    contact_forces = True
    start_forces = True

    def place(self, worlds: Worlds) -> Tensor:
        """Return the place of the centre of mass, m, shape (n, 2)."""
        mass = worlds.row("body_mass")
        return (mass[..., None] * worlds.xipos[..., :2]).sum(dim=1) / mass.sum(dim=1)[:, None]

    @override
    def observations(self, worlds: Worlds) -> Tensor:
        blocks = [
            getattr(worlds, name)[:, first:].flatten(1)
            for name, first in _BLOCKS.items()
            if getattr(self._env, f"_include_{name}_in_observation") is True
        ]
        return torch.cat([super().observations(worlds), *blocks], dim=1)

    def _contact_cost(self, worlds: Worlds) -> Tensor:
        cost = _cost(self._env._contact_cost_weight, worlds.cfrc_ext)
        return cost.clamp(*self._env._contact_cost_range)

    @override
    def start_infos(self, worlds: Worlds) -> dict[str, Tensor]:
        tendons = worlds.ten_length.clone(), worlds.ten_velocity.clone()
        return {**_place_infos(worlds), "tendon_length": tendons[0], "tendon_velocity": tendons[1]}


TASKS: Final[dict[type[Any], type[DeviceTask]]] = {
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
"""Batched functions of bodies, keyed by the class of their CPU env."""


def _base(env: Any) -> Any:
    """Return Gymnasium's class of an env."""
    return next(base for base in type(env).__mro__ if base.__module__.startswith("gymnasium."))
