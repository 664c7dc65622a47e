"""Poses that follow from a body: joints within limits, feet on the floor, how high it stands."""

from __future__ import annotations

from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_J = mujoco.mjtJoint
_GROUND: Final = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))

# A joint starts at least this part of its range inside its limits: at the limit itself the limit's
# spring would already push.
_INSIDE: Final = 0.1
# How far down a floor is looked for; a body that stands higher stands on nothing.
_FAR_M: Final = 1000.0
# How near to 1 the vertical part of an axis is when it counts as vertical.
_VERTICAL: Final = 1e-6


class Lift(NamedTuple):
    """The number of qpos that raises a trunk.

    Attributes:
        place: Its place in qpos.
        up: 1 where a larger number is higher; -1 where it is lower, as on a slide that points down.
        at_zero_m: Height of the trunk's origin in the world where the number is 0, m.
    """

    place: int
    up: float
    at_zero_m: float

    def raise_by(self, pose: _Array, distance_m: float) -> None:
        """Move the trunk of a pose up, in place.

        Args:
            pose: Shape (nq,).
            distance_m: Distance, m.
        """
        pose[self.place] += self.up * distance_m

    def height(self, pose: _Array) -> float:
        """Return the height of the trunk's origin at a pose (nq,), m."""
        return float(self.at_zero_m + self.up * pose[self.place])

    def number_at(self, height_m: float) -> float:
        """The number at which the trunk's origin is this high."""
        return self.up * (height_m - self.at_zero_m)


def trunk_joint(model: mujoco.MjModel) -> int | None:
    """The number of the first free joint; None for a body that is fixed to the world."""
    free = np.flatnonzero(model.jnt_type == _J.mjJNT_FREE)
    return int(free[0]) if free.size else None


def travelling_body(model: mujoco.MjModel) -> int | None:
    """Return the number of the body that can go anywhere; None for one that stays at its place.

    That of the first free joint; without one, the first body on the world that slides without
    limits, as those that run in a plane do.
    """
    trunk = trunk_joint(model)
    if trunk is not None:
        return int(model.jnt_bodyid[trunk])
    slides = (model.jnt_type == _J.mjJNT_SLIDE) & (model.jnt_limited == 0)
    found = np.flatnonzero(slides & (model.body_parentid[model.jnt_bodyid] == 0))
    return int(model.jnt_bodyid[found[0]]) if found.size else None


def trunk_lift(model: mujoco.MjModel) -> Lift | None:
    """Return the coordinate that raises the trunk; None for a body that cannot be raised.

    That of the first free joint; without one, the first vertical slide of a body that hangs on the
    world, unless it has limits: a hoist does not stand.
    """
    trunk = trunk_joint(model)
    if trunk is not None:
        return Lift(int(model.jnt_qposadr[trunk]) + 2, 1.0, 0.0)
    slides = (model.jnt_type == _J.mjJNT_SLIDE) & (model.jnt_limited == 0)
    for joint in np.flatnonzero(slides & (model.body_parentid[model.jnt_bodyid] == 0)):
        body, axis = model.jnt_bodyid[joint], np.zeros(3)
        mujoco.mju_rotVecQuat(axis, model.jnt_axis[joint], model.body_quat[body])
        if abs(axis[2]) > 1.0 - _VERTICAL:
            place, up = int(model.jnt_qposadr[joint]), float(np.sign(axis[2]))
            # `ref` is the number at which the body is where the model puts it.
            return Lift(place, up, float(model.body_pos[body, 2] - up * model.qpos0[place]))
    return None


def start_pose(model: mujoco.MjModel, inside: float = _INSIDE) -> _Array:
    """Return the model's own pose, shape (nq,), moved to where it is possible.

    Each joint is as near to the model's pose as the part `inside` of its range inside its limits
    allows, and a trunk that can be raised stands no lower than its feet need.

    Args:
        model: The model.
        inside: Share of each joint's range to keep from its limits.
    """
    pose = model.qpos0.copy()
    places, lower, upper = _limits(model)
    margin = inside * (upper - lower)
    pose[places] = np.clip(pose[places], lower + margin, upper - margin)
    lift = trunk_lift(model)
    if lift is not None:
        lift.raise_by(pose, max(0.0, -_gap_at(model, pose)))
    return pose


def keep_within_limits(model: mujoco.MjModel, pose: _Array) -> _Array:
    """Return a pose, shape (nq,), with every hinge and slide moved inside its limits.

    Args:
        model: The model.
        pose: Shape (nq,).
    """
    return _within(pose, *_limits(model))


def standing_height(model: mujoco.MjModel, pose: _Array | None = None) -> float | None:
    """Return the height of the trunk's origin when the lowest point touches the floor, m.

    Args:
        model: The body.
        pose: The pose (nq,) in which it stands; None for each joint in the middle of its range and
            the trunk upright.

    Returns:
        None for a body that nothing raises or that has no floor to stand on.
    """
    lift = trunk_lift(model)
    if lift is None:
        return None
    if pose is None:
        pose = model.qpos0.copy()
        places, lower, upper = _limits(model)
        pose[places] = 0.5 * (lower + upper)
    gap = _gap_at(model, pose)
    return None if gap >= _FAR_M else lift.height(pose) - gap


def floor_gap(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Return the clearance of the body's lowest point above the floor, m; negative inside it.

    `data` must hold the geoms' places, as after `mj_kinematics`. The floor is every plane and
    height field that is fixed to the world and can touch the body's geoms; 1000 where there is
    none.
    """
    return _gap(model, data, _floors_and_geoms(model))


def _gap_at(model: mujoco.MjModel, pose: _Array) -> float:
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    return floor_gap(model, data)


class StartRules:
    """Rules for possible start poses, read from a model once.

    Attributes:
        lift: What raises the trunk, as of `trunk_lift`.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.lift = trunk_lift(model)
        self._limits = _limits(model)
        self._pairs = _floors_and_geoms(model)

    def keep_within_limits(self, pose: _Array) -> _Array:
        """As the function of this name."""
        return _within(pose, *self._limits)

    def floor_gap(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Return the clearance above the floor; see the function of this name."""
        return _gap(model, data, self._pairs)


def _within(pose: _Array, places: NDArray[np.intp], lower: _Array, upper: _Array) -> _Array:
    """The pose with the numbers at these places between their limits."""
    result = pose.copy()
    result[places] = np.clip(pose[places], lower, upper)
    return result


def _floors_and_geoms(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Each floor with each geom of the body that it can touch."""
    of_world = model.body_weldid[model.geom_bodyid] == 0
    pairs: list[tuple[int, int]] = []
    for floor in np.flatnonzero(of_world & np.isin(model.geom_type, _GROUND)):
        touching = (model.geom_contype & model.geom_conaffinity[floor]) | (
            model.geom_conaffinity & model.geom_contype[floor]
        )
        pairs += [(int(floor), int(geom)) for geom in np.flatnonzero(~of_world & (touching != 0))]
    return pairs


def _gap(model: mujoco.MjModel, data: mujoco.MjData, pairs: list[tuple[int, int]]) -> float:
    """The smallest distance between the geoms of these pairs, m."""
    gap = _FAR_M
    for floor, geom in pairs:
        gap = min(gap, mujoco.mj_geomDistance(model, data, floor, geom, _FAR_M, None))
    return gap


def _limits(model: mujoco.MjModel) -> tuple[NDArray[np.intp], _Array, _Array]:
    """Places in qpos and limits of the hinges and slides that have limits."""
    one_number = np.isin(model.jnt_type, (int(_J.mjJNT_HINGE), int(_J.mjJNT_SLIDE)))
    joints = np.flatnonzero(one_number & (model.jnt_limited != 0))
    lower, upper = model.jnt_range[joints].T
    return model.jnt_qposadr[joints].astype(np.intp), lower, upper
