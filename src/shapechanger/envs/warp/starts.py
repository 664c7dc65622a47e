"""Start states of many worlds: noise around each body's pose, made feasible."""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shapechanger.envs.warp.noise import normals, uniforms
from shapechanger.envs.warp.worlds import Worlds
from shapechanger.errors import VectorEnvError
from shapechanger.morphology.pose import StartRules

_G: Final = mujoco.mjtGeom
_SPHERE: Final = int(_G.mjGEOM_SPHERE)
_CAPSULE: Final = int(_G.mjGEOM_CAPSULE)
_ELLIPSOID: Final = int(_G.mjGEOM_ELLIPSOID)
_CYLINDER: Final = int(_G.mjGEOM_CYLINDER)
_BOX: Final = int(_G.mjGEOM_BOX)
_SHAPES: Final = (_SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX)
# Where the numbers of a joint have its quaternion.
_QUATERNION_AT: Final = {
    int(mujoco.mjtJoint.mjJNT_FREE): 3,
    int(mujoco.mjtJoint.mjJNT_BALL): 0,
}
_PLANE: Final = int(_G.mjGEOM_PLANE)
# Streams of random numbers.
_POSITIONS: Final = 0
_VELOCITIES: Final = 1


class DeviceStarts:
    """`StartRules` of many bodies whose arrays have the same shapes.

    Args:
        model: A body of the batch, which gives the places of the numbers.
        worlds: The worlds.
        noise_scale: Scale of the noise, rad, m, rad/s and m/s.
        normal_velocities: Whether velocities are drawn normally, else uniformly.

    Raises:
        VectorEnvError: If the body starts above something else than planes, or a geom that can
            touch the floor has a shape without a batched clearance.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        worlds: Worlds,
        noise_scale: float,
        normal_velocities: bool,
    ) -> None:
        rules = StartRules(model)
        self._worlds = worlds
        self._noise_scale = noise_scale
        self._normal_velocities = normal_velocities
        device = worlds.qpos.device
        self._limited = torch.as_tensor(rules.limited_places, device=device)
        self._quaternions = [
            int(address) + _QUATERNION_AT[int(kind)]
            for address, kind in zip(model.jnt_qposadr, model.jnt_type, strict=True)
            if int(kind) in _QUATERNION_AT
        ]
        self._lift = rules.lift
        # Each floor with geoms of one shape.
        touching: dict[tuple[int, int], list[int]] = {}
        for floor, geom in rules.floor_pairs if rules.lift is not None else ():
            shape = int(model.geom_type[geom])
            if model.geom_type[floor] != _PLANE or shape not in _SHAPES:
                raise VectorEnvError(
                    "Bodies of backend='warp' start above planes, with spheres, capsules, "
                    "ellipsoids, cylinders and boxes; here "
                    f"{_G(int(model.geom_type[floor])).name} meets {_G(shape).name}."
                )
            touching.setdefault((floor, shape), []).append(geom)
        self._geoms = {pair: torch.tensor(geoms, device=device) for pair, geoms in touching.items()}

    @staticmethod
    def constants(env: Any) -> dict[str, NDArray[Any]]:
        """Return the numbers of a body's start.

        Args:
            env: A CPU env with the body.
        """
        rules = StartRules(env.model)
        return {
            "init_qpos": np.array(env.init_qpos),
            "init_qvel": np.array(env.init_qvel),
            "lowest": np.array(rules.lowest),
            "highest": np.array(rules.highest),
        }

    def draw(
        self, constants: dict[str, Tensor], seeds: Tensor, episodes: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return positions (n, nq) and velocities (n, nv) with the noise of the task.

        Args:
            constants: Numbers of each world's body.
            seeds: The seed of each world, shape (n,).
            episodes: How many episodes each world has begun, shape (n,).
        """
        scale, qpos, qvel = self._noise_scale, constants["init_qpos"], constants["init_qvel"]
        moved = 2.0 * uniforms(seeds, episodes, _POSITIONS, qpos.shape[1]) - 1.0
        if self._normal_velocities:
            pushed = normals(seeds, episodes, _VELOCITIES, qvel.shape[1])
        else:
            pushed = 2.0 * uniforms(seeds, episodes, _VELOCITIES, qvel.shape[1]) - 1.0
        return qpos + (scale * moved).to(qpos.dtype), qvel + (scale * pushed).to(qvel.dtype)

    def settle(self, mask: Tensor, constants: dict[str, Tensor]) -> None:
        """Make the positions of some worlds feasible, in place.

        Joints are moved inside their limits, orientations normalised, and a trunk whose feet are in
        the floor is lifted. Afterwards `kinematics` or `forward` must be called.

        Args:
            mask: Which worlds, shape (n,).
            constants: Numbers of each world's body.
        """
        qpos = self._worlds.qpos
        places = self._limited
        within = qpos.clone()
        within[:, places] = qpos[:, places].clamp(constants["lowest"], constants["highest"])
        for place in self._quaternions:
            part = within[:, place : place + 4]
            within[:, place : place + 4] = torch.nn.functional.normalize(part, dim=1)
        qpos.copy_(torch.where(mask[:, None], within, qpos))
        if self._lift is not None:
            self._worlds.kinematics()
            lack = (-self._floor_gap()).clamp_min(0.0).masked_fill(~mask, 0.0)
            qpos[:, self._lift.place] += self._lift.up * lack

    def _floor_gap(self) -> Tensor:
        """Return the clearance of each body's lowest point above the floor, m, shape (n,)."""
        worlds = self._worlds
        gap = worlds.qpos.new_full((worlds.count,), torch.inf)
        for (floor, shape), geoms in self._geoms.items():
            up = worlds.geom_xmat[:, floor, :, 2]
            above = worlds.geom_xpos[:, geoms] - worlds.geom_xpos[:, floor, None]
            height = torch.einsum("ngi,ni->ng", above, up)
            # The plane's normal as each geom sees it.
            seen = torch.einsum("ngij,ni->ngj", worlds.geom_xmat[:, geoms], up)
            reach = _reach(shape, worlds.row("geom_size")[:, geoms], seen)
            gap = torch.minimum(gap, (height - reach).amin(dim=1))
        return gap


def length(vectors: Tensor) -> Tensor:
    """Return the lengths of vectors, shape (..., k), as shape (...)."""
    return vectors.square().sum(dim=-1).sqrt()


def _reach(shape: int, size: Tensor, towards: Tensor) -> Tensor:
    """Return how far geoms of one shape reach from their middle in a direction, m, shape (n, k).

    Args:
        shape: Their shape.
        size: Their sizes as MuJoCo has them, m, shape (n or 1, k, 3).
        towards: The direction in each geom's own axes, shape (n, k, 3).
    """
    radius, half = size[..., 0], size[..., 1]
    if shape == _SPHERE:
        return radius.expand(towards.shape[:2])
    if shape == _CAPSULE:
        return radius + half * towards[..., 2].abs()
    if shape == _ELLIPSOID:
        return length(size * towards)
    if shape == _CYLINDER:
        return radius * length(towards[..., :2]) + half * towards[..., 2].abs()
    return (size * towards.abs()).sum(dim=-1)
