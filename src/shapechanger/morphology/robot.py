"""The part of a model that is the robot: all that its actuators move, directly or by a coupling.

A file may hold a robot and objects, in any order. Trunk, standing height, mass, start poses and
limbs are the robot's.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.certificate.fields import kinds_of


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
    kinds, moved = kinds_of(model), dict[int, int]()

    def trees(kind: str, ends: list[int]) -> set[int]:
        bodies = [body for end in ends for body in _bodies(model, kinds, kind, end)]
        return {int(model.body_treeid[body]) for body in bodies} - {-1}

    pulled = zip(kinds["actuator_target_kinds"], model.actuator_trnid.tolist(), strict=True)
    for kind, ends in pulled:
        for tree in trees(kind, ends if kind == "sites" else ends[:1]):
            moved[tree] = moved.get(tree, 0) + 1
    coupled = [
        trees(kinds["eq_kinds"][i], [int(model.eq_obj1id[i]), int(model.eq_obj2id[i])])
        for i in np.flatnonzero(model.eq_active0).tolist()
    ]
    size = -1
    while size < len(moved):  # No actuator counts for what an equality couples.
        size = len(moved)
        for tied in coupled:
            if not tied.isdisjoint(moved):
                moved |= dict.fromkeys(tied - moved.keys(), 0)
    return sorted(moved, key=lambda tree: (-moved[tree], tree)) or everything


def _bodies(model: mujoco.MjModel, kinds: dict[str, list[str]], kind: str, at: int) -> list[int]:
    """Return the body that an element is on, or all along a tendon; none for other kinds."""
    carriers = {"joints": "jnt_bodyid", "sites": "site_bodyid", "geoms": "geom_bodyid"}
    if at < 0 or kind not in (*carriers, "bodies", "tendons"):
        return []
    if kind == "tendons":
        start = int(model.tendon_adr[at])
        path = range(start, start + int(model.tendon_num[at]))
        parts = [(kinds["wrap_kinds"][i], int(model.wrap_objid[i])) for i in path]
        return [body for part in parts for body in _bodies(model, kinds, *part)]
    return [at if kind == "bodies" else int(getattr(model, carriers[kind])[at])]
