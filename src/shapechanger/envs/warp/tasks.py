"""What the tasks of many worlds share: their constants, and starts that follow `StartRules`.

The functions of each body are next to its env, such as `envs.ant_gpu`. If the reward formula of a
CPU env does not read a simulation, they call it with tensors. Weights and ranges that an argument
or a body can change are read from a CPU env.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from typing_extensions import override

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

Outcome = tuple[Tensor, Tensor, Infos]
"""Rewards, terminations and infos."""


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


def cost(weight: float, numbers: Tensor) -> Tensor:
    """Return a weighted sum of squares over all but the first axis, shape (n,)."""
    return weight * numbers.square().flatten(1).sum(dim=1)


def gymnasium_class_of(env: Any) -> Any:
    """Return the class of Gymnasium from which an env is derived."""
    return next(base for base in type(env).__mro__ if base.__module__.startswith("gymnasium."))
