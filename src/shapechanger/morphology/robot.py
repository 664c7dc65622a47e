"""The part of a model that is the robot: all that its actuators move, directly or by a coupling.

A file may hold a robot and objects, in any order. Trunk, standing height, mass, start poses and
limbs are those of the robot.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

_T = mujoco.mjtTrn
_E = mujoco.mjtEq
_OF_JOINT = (int(_T.mjTRN_JOINT), int(_T.mjTRN_JOINTINPARENT))
_OF_SITE = (int(_T.mjTRN_SITE), int(_T.mjTRN_SLIDERCRANK))


def robot_bodies(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return whether each body is part of the robot, shape (nbody,).

    The robot is every kinematic tree that an actuator moves, through a joint, tendon, site or body;
    every tree that an active equality couples to one of these, as the second finger of a gripper or
    a link of a closed loop; and the fixed bodies that carry them. In a model without actuators it
    is everything. The world is never part of it.

    Args:
        model: The model.
    """
    trees, of_tree = moved_trees(model), model.body_treeid
    roots = model.body_rootid[np.isin(of_tree, trees)]
    mask = np.isin(of_tree, trees) | ((of_tree < 0) & np.isin(model.body_rootid, roots))
    mask[0] = False
    return mask


def moved_trees(model: mujoco.MjModel) -> list[int]:
    """Return the kinematic trees of the robot; the one that most actuators move comes first.

    Args:
        model: The model.
    """
    everything = list(range(int(model.ntree)))
    if len(everything) < 2 or not model.nu:
        return everything
    moved: dict[int, int] = {}
    for actuator in range(model.nu):
        for tree in {int(model.body_treeid[body]) for body in _moved_bodies(model, actuator)}:
            if tree >= 0:
                moved[tree] = moved.get(tree, 0) + 1
    _follow_equalities(model, moved)
    return sorted(moved, key=lambda tree: (-moved[tree], tree)) or everything


def _follow_equalities(model: mujoco.MjModel, moved: dict[int, int]) -> None:
    """Add the trees that active equalities couple to moved ones, which no actuator counts for."""
    coupled = [
        {int(model.body_treeid[body]) for body in _coupled_bodies(model, equality)} - {-1}
        for equality in np.flatnonzero(model.eq_active0).tolist()
    ]
    size = -1
    while size < len(moved):
        size = len(moved)
        for trees in coupled:
            if not trees.isdisjoint(moved):
                for tree in trees:
                    moved.setdefault(tree, 0)


def _coupled_bodies(model: mujoco.MjModel, equality: int) -> list[int]:
    """Return the bodies that an equality couples."""
    kind = int(model.eq_type[equality])
    ends = [int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])]
    if kind == _E.mjEQ_JOINT:
        return [int(model.jnt_bodyid[end]) for end in ends if end >= 0]
    if kind == _E.mjEQ_TENDON:
        return [body for end in ends if end >= 0 for body in _along_tendon(model, end)]
    if kind not in (_E.mjEQ_CONNECT, _E.mjEQ_WELD):
        return []
    if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
        return [int(model.site_bodyid[end]) for end in ends]
    return ends


def _moved_bodies(model: mujoco.MjModel, actuator: int) -> list[int]:
    """Return the bodies that an actuator pulls at."""
    kind = int(model.actuator_trntype[actuator])
    first, second = (int(each) for each in model.actuator_trnid[actuator])
    if kind in _OF_JOINT:
        return [int(model.jnt_bodyid[first])]
    if kind in _OF_SITE:
        return [int(model.site_bodyid[site]) for site in (first, second) if site >= 0]
    if kind == _T.mjTRN_TENDON:
        return _along_tendon(model, first)
    return [first] if kind == _T.mjTRN_BODY else []


def _along_tendon(model: mujoco.MjModel, tendon: int) -> list[int]:
    """Return the bodies that a tendon runs along."""
    of_kind = {
        int(mujoco.mjtWrap.mjWRAP_JOINT): model.jnt_bodyid,
        int(mujoco.mjtWrap.mjWRAP_SITE): model.site_bodyid,
        int(mujoco.mjtWrap.mjWRAP_SPHERE): model.geom_bodyid,
        int(mujoco.mjtWrap.mjWRAP_CYLINDER): model.geom_bodyid,
    }
    start = int(model.tendon_adr[tendon])
    path = range(start, start + int(model.tendon_num[tendon]))
    return [
        int(of_kind[int(model.wrap_type[i])][model.wrap_objid[i]])
        for i in path
        if int(model.wrap_type[i]) in of_kind
    ]
