"""Poses that follow from a body: joints within limits, feet on the floor, how high it stands."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

__all__ = ["floor_gap", "keep_within_limits", "standing_height", "start_pose", "trunk_joint"]

_Array = NDArray[np.float64]
_J = mujoco.mjtJoint
_GROUND: Final = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))

# A joint starts at least this part of its range inside its limits: at the limit itself the limit's
# spring would already push.
_INSIDE: Final = 0.1
# How far down a floor is looked for; a body that stands higher stands on nothing.
_FAR_M: Final = 1000.0


def trunk_joint(model: mujoco.MjModel) -> int | None:
    """The number of the first free joint; None for a body that is fixed to the world."""
    free = np.flatnonzero(model.jnt_type == _J.mjJNT_FREE)
    return int(free[0]) if free.size else None


def start_pose(model: mujoco.MjModel) -> _Array:
    """The pose to start from, shape (nq,): the model's own, made possible.

    Each joint is as near to the model's pose as a tenth of its range inside its limits allows, and
    a trunk that is free stands no lower than its feet need.
    """
    pose = model.qpos0.copy()
    places, lower, upper = _limits(model)
    inside = _INSIDE * (upper - lower)
    pose[places] = np.clip(pose[places], lower + inside, upper - inside)
    trunk = trunk_joint(model)
    if trunk is not None:
        pose[model.jnt_qposadr[trunk] + 2] += max(0.0, -_gap_at(model, pose))
    return pose


def keep_within_limits(model: mujoco.MjModel, pose: _Array) -> _Array:
    """The pose, shape (nq,), with every hinge and slide moved inside its limits."""
    result = pose.copy()
    places, lower, upper = _limits(model)
    result[places] = np.clip(result[places], lower, upper)
    return result


def standing_height(model: mujoco.MjModel) -> float | None:
    """How high the trunk's origin is when the lowest point touches the floor, m.

    Each joint is in the middle of its range and the trunk upright. None for a body that is fixed to
    the world or has no floor to stand on.
    """
    trunk = trunk_joint(model)
    if trunk is None:
        return None
    pose = model.qpos0.copy()
    places, lower, upper = _limits(model)
    pose[places] = 0.5 * (lower + upper)
    gap = _gap_at(model, pose)
    return None if gap >= _FAR_M else float(pose[model.jnt_qposadr[trunk] + 2] - gap)


def floor_gap(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """How far the body's lowest point is above the floor, m; negative when it is inside.

    `data` must hold the geoms' places, as after `mj_kinematics`. The floor is every plane and
    height field that is fixed to the world and can touch the body's geoms; 1000 where there is
    none.
    """
    of_world = model.body_weldid[model.geom_bodyid] == 0
    gap = _FAR_M
    for floor in np.flatnonzero(of_world & np.isin(model.geom_type, _GROUND)):
        touching = (model.geom_contype & model.geom_conaffinity[floor]) | (
            model.geom_conaffinity & model.geom_contype[floor]
        )
        for geom in np.flatnonzero(~of_world & (touching != 0)):
            gap = min(gap, mujoco.mj_geomDistance(model, data, floor, geom, _FAR_M, None))
    return gap


def _gap_at(model: mujoco.MjModel, pose: _Array) -> float:
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    return floor_gap(model, data)


def _limits(model: mujoco.MjModel) -> tuple[NDArray[np.intp], _Array, _Array]:
    """Places in qpos and limits of the hinges and slides that have limits."""
    one_number = np.isin(model.jnt_type, (int(_J.mjJNT_HINGE), int(_J.mjJNT_SLIDE)))
    joints = np.flatnonzero(one_number & (model.jnt_limited != 0))
    lower, upper = model.jnt_range[joints].T
    return model.jnt_qposadr[joints].astype(np.intp), lower, upper
