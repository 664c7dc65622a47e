"""Tasks as functions of the state of many worlds, with the constants of their CPU envs.

If the reward formula of a CPU env does not read a simulation, it is called with tensors. Every
weight and range is read from a CPU env.
"""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any, ClassVar, Final

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import override

from shapechanger.envs.ant import AntEnv, ExtendedAntEnv, is_upright
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
    HumanoidEnv,
    SwimmerEnv,
    Walker2dEnv,
)
from shapechanger.envs.warp.kernels import uniforms
from shapechanger.envs.warp.worlds import Infos, Worlds, geom_type
from shapechanger.errors import VectorEnvError
from shapechanger.morphology.pose import StartRules

_SHAPES: Final = ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
# Offset of the quaternion in the numbers of a joint in `qpos`.
_QUATERNION_AT: Final = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
# Streams of random numbers.
_POSITIONS: Final = 0
_VELOCITIES: Final = 1

# Rewards, terminations and infos.
_Outcome = tuple[Tensor, Tensor, Infos]


class DeviceTask(Worlds):
    """A task whose starts follow `StartRules`: noise around each body's pose, made feasible.

    Attributes:
        normal_velocities: Whether start velocities are drawn normally; if not, uniformly.
        place_size: How many coordinates of the trunk the rewards and infos read, 0 to 2.
    """

    normal_velocities: ClassVar[bool] = False
    place_size = 0

    def __init__(self, env: Any, model: mujoco.MjModel, *args: Any, **kwargs: Any) -> None:
        self.place_size: int = getattr(env, "place_size", self.place_size)
        super().__init__(env, model, *args, **kwargs)
        rules = StartRules(model)
        self._limited = torch.as_tensor(rules.limited_places, device=self.device)
        self._quaternions = [
            int(address) + _QUATERNION_AT[kind]
            for address, kind in zip(model.jnt_qposadr, model.jnt_type.tolist(), strict=True)
            if kind in _QUATERNION_AT
        ]
        self._lift = rules.lift
        # The geoms that can touch each floor, grouped by shape.
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
            pair: torch.tensor(geoms, device=self.device) for pair, geoms in touching.items()
        }

    @staticmethod
    def constants_of(env: Any) -> dict[str, NDArray[Any]]:
        """Return the numbers of the task that depend on the body of a CPU env."""
        rules = StartRules(env.model)
        found = {"init_qpos": env.init_qpos, "init_qvel": env.init_qvel, "dt": env.dt}
        found |= {"lowest": rules.lowest, "highest": rules.highest}
        if hasattr(env, "healthy_z_range"):
            found["low"], found["high"] = env.healthy_z_range
        return {name: np.array(value) for name, value in found.items()}

    @override
    def begin(self, mask: Tensor, seeds: Tensor, episodes: Tensor) -> None:
        constants, scale = self.constants, float(self._env._reset_noise_scale)
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
        self.qpos.copy_(torch.where(mask[:, None], qpos, self.qpos))
        self.qvel.copy_(torch.where(mask[:, None], qvel, self.qvel))
        if self._lift is not None:  # Lift a trunk whose feet are in the floor.
            self.kinematics()
            lack = (-self._clearance()).clamp_min(0.0).masked_fill(~mask, 0.0)
            self.qpos[:, self._lift.place] += self._lift.up * lack

    def _clearance(self) -> Tensor:
        """Return how far each body's lowest point is above the floor, m, shape (n,)."""
        gap = self.qpos.new_full((self.count,), torch.inf)
        for (floor, shape), geoms in self._touching.items():
            up = self.geom_xmat[:, floor, :, 2]
            above = self.geom_xpos[:, geoms] - self.geom_xpos[:, floor, None]
            height = torch.einsum("ngi,ni->ng", above, up)
            # The plane's normal as each geom sees it.
            seen = torch.einsum("ngij,ni->ngj", self.geom_xmat[:, geoms], up)
            reach = _reach(shape, self.row("geom_size")[:, geoms], seen)
            gap = torch.minimum(gap, (height - reach).amin(dim=1))
        return gap

    @override
    def place(self) -> Tensor:
        """Return the place of the trunk, m, shape (n, place_size)."""
        return self.qpos[:, : self.place_size]

    @override
    def start_infos(self) -> Infos:
        place = self.qpos[:, : self.place_size]
        infos = {f"{axis}_position": at.clone() for axis, at in zip("xy", place.T, strict=False)}
        return {**infos, "distance_from_origin": length(place)} if self.place_size == 2 else infos


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


def _cost(weight: float, numbers: Tensor) -> Tensor:
    return weight * numbers.square().flatten(1).sum(dim=1)


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
    def outcome(self, before: Tensor, actions: Tensor) -> _Outcome:
        env, qpos, constants = self._env, self.qpos, self.constants
        velocity = (self.place() - before) / constants["dt"][:, None]
        limits = constants["low"], constants["high"]
        healthy = is_upright(qpos[:, 2], qpos[:, 4], qpos[:, 5], *limits)
        healthy &= qpos.isfinite().all(dim=1) & self.qvel.isfinite().all(dim=1)
        effort = _cost(env._ctrl_cost_weight, actions)
        contact = _cost(env._contact_cost_weight, self._forces())
        place = self.start_infos().values()
        rewards, infos = env._reward(place, velocity.T, effort, contact, healthy)
        return rewards, ~healthy & bool(env._terminate_when_unhealthy), infos


class DevicePendulum(DeviceTask):
    """Inverted pendulums of any length."""

    @override
    def observations(self) -> Tensor:
        return torch.cat([self.qpos, self.qvel], dim=1)

    @override
    def outcome(self, before: Tensor, actions: Tensor) -> _Outcome:
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
    def outcome(self, before: Tensor, actions: Tensor) -> _Outcome:
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
        rewards, infos = _base(env)._get_rew(there, tip[:, 0], height, True)
        bonus = env._healthy_reward * (~fallen).to(height.dtype)
        return rewards + bonus, fallen, {**infos, "reward_survive": bonus}


class DeviceRunner(DeviceTask):
    """Runners whose episodes never terminate."""

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
    def outcome(self, before: Tensor, actions: Tensor) -> _Outcome:
        env = self._env
        velocity = (self.place() - before) / self.constants["dt"][:, None]
        healthy = self._healthy()
        # Attributes of the env that Gymnasium's formula reads.
        there = SimpleNamespace(
            _forward_reward_weight=env._forward_reward_weight,
            healthy_reward=healthy * getattr(env, "_healthy_reward", 0.0),
            control_cost=partial(_cost, env._ctrl_cost_weight),
            contact_cost=self._contact_cost(),
        )
        rewards, terms = _base(env)._get_rew(there, velocity[:, 0], actions)
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
        cost = _cost(self._env._contact_cost_weight, self.cfrc_ext)
        return cost.clamp(*self._env._contact_cost_range)

    @override
    def start_infos(self) -> Infos:
        tendons = {"tendon_length": self.ten_length, "tendon_velocity": self.ten_velocity}
        return super().start_infos() | {name: each.clone() for name, each in tendons.items()}


TASKS: Final[dict[type[Any], type[DeviceTask]]] = {
    AntEnv: DeviceAnt,
    ExtendedAntEnv: DeviceAnt,
    InvertedPendulumEnv: DevicePendulum,
    InvertedDoublePendulumEnv: DeviceDoublePendulum,
    HalfCheetahEnv: DeviceCheetah,
    HopperEnv: DeviceHopper,
    Walker2dEnv: DeviceWalker,
    SwimmerEnv: DeviceRunner,
    HumanoidEnv: DeviceHumanoid,
}
"""Batched functions of bodies, keyed by the class of their CPU env."""


def _base(env: Any) -> Any:
    """Return Gymnasium's class of an env."""
    return next(base for base in type(env).__mro__ if base.__module__.startswith("gymnasium."))
