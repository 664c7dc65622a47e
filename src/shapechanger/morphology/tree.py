"""The kinematic tree of a body: its trunk, its limbs, and numbers that describe each.

A policy for many bodies observes these numbers in addition to the state: N. Bohlinger and others,
One Policy to Run Them All, CoRL 2024, and A. Gupta and others, MetaMorph, ICLR 2022.
"""

from __future__ import annotations

import math
from typing import Final

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.pose import GROUND, posed, robot_bodies, travelling_body
from shapechanger.morphology.spec.references import OF_JOINTS

_Array = NDArray[np.float64]
_J: Final = mujoco.mjtJoint
_LONG: Final = (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER))
_MOVES_ONE_WAY: Final = (int(_J.mjJNT_HINGE), int(_J.mjJNT_SLIDE))
_NO_MOMENT: Final = 1e-9  # A smaller moment, m or 1, is rounding.
_EQUAL: Final = 1e-6  # Moments that differ by a smaller share are equal.

LIMB_NUMBERS: Final = (
    *("joint x", "joint y", "joint z", "distance"),  # Direction from the trunk's origin; m.
    *("axis x", "axis y", "axis z"),
    *("end x", "end y", "end z", "length"),  # Direction from joint to farthest end; m.
    *("mass", "mass with limbs"),  # Decades above 1 kg.
    *("start", "lower", "upper"),  # Start and limits of the joint, rad or m; 0 without limits.
    *("strength", "damping", "armature"),  # Logarithms, so that each is about 1.
    *("limited", "slides", "depth"),
)
"""Meaning of the numbers of a limb; vectors are in the trunk's frame, in the start pose.

Directions are separate from lengths, so that a leg in front on the left has the same direction for
any size.
"""

TRUNK_NUMBERS: Final = ("mass", "mass with limbs", "start height", "radius", "friction", "gravity")
"""Meaning of the numbers of a trunk: decades above 1 kg, m, m, and ratios to 1 and 9.81 m/s²."""


class Limb(msgspec.Struct, frozen=True):
    """One joint, and the segment that it moves up to the next joint.

    Attributes:
        joint: Name of the hinge or slide.
        bodies: Names of the body that the joint moves and of bodies fixed to it; empty if a later
            joint of the same body lists them.
        actuator: Name of the actuator that moves the joint; "" if no actuator moves it. An actuator
            of a tendon, site or body is assigned to one of the joints without an actuator: the one
            that it turns most in the start pose, and of equal ones the nearest to the trunk.
        numbers: Description of the limb, see `LIMB_NUMBERS`.
    """

    joint: str
    bodies: tuple[str, ...]
    actuator: str
    numbers: tuple[float, ...]


class Tree(msgspec.Struct, frozen=True):
    """A trunk and its limbs.

    Attributes:
        trunk: Names of the trunk's body and of bodies fixed to it; the trunk of a robot that cannot
            travel is the world.
        numbers: Description of the trunk, see `TRUNK_NUMBERS`.
        limbs: Its limbs, each after the limb that carries it.
    """

    trunk: tuple[str, ...]
    numbers: tuple[float, ...]
    limbs: tuple[Limb, ...]
    trunk_numbers: tuple[str, ...] = TRUNK_NUMBERS
    limb_numbers: tuple[str, ...] = LIMB_NUMBERS


def tree_of(model: mujoco.MjModel, pose: _Array) -> Tree:
    """Describe the kinematic tree of a body in its start pose (nq,)."""
    data = posed(model, pose)
    mujoco.mj_comPos(model, data)  # Masses of subtrees.
    mujoco.mj_tendon(model, data)
    mujoco.mj_transmission(model, data)
    trunk, robot = travelling_body(model) or 0, robot_bodies(model)
    moves = np.isin(model.jnt_type, _MOVES_ONE_WAY) & robot[model.jnt_bodyid]
    joints = np.flatnonzero(moves & ((model.jnt_bodyid != trunk) | (trunk == 0))).tolist()
    # The last joint of a body moves it.
    mover = {int(model.jnt_bodyid[j]): j for j in joints}
    owner: dict[int, int | None] = {0: None}
    for body in range(1, model.nbody):
        owner[body] = mover.get(body, owner[int(model.body_parentid[body])])
    moments = _moments(model, data)
    moved_by = _actuators_by_joint(model, moments, joints, owner)
    limbs: list[Limb] = []
    for j in joints:
        own, actuator, strength = [body for body in owner if owner[body] == j], "", 0.0
        if (moving := moved_by.get(j)) is not None:
            actuator = model.actuator(moving).name
            strength = _force(model, moving) * moments[moving, model.jnt_dofadr[j]]
        numbers = _limb_numbers(model, data, j, own, trunk, strength)
        names = tuple(model.body(body).name for body in own)
        limbs.append(Limb(model.joint(j).name, names, actuator, numbers))
    own = [body for body in owner if owner[body] is None and (robot[body] or body == trunk == 0)]
    floor = np.flatnonzero(model.geom_bodyid == 0)
    numbers = (
        *(_decades(model.body_mass[own].sum()), _decades(model.body_subtreemass[trunk])),
        *(data.xpos[trunk, 2], _farthest(model, data, own, data.xpos[trunk])[1]),
        model.geom_friction[floor[0], 0] if floor.size else 1.0,
        np.linalg.norm(model.opt.gravity) / 9.81,
    )
    names = tuple(model.body(body).name for body in own)
    return Tree(names, tuple(map(float, numbers)), tuple(limbs))


def _moments(model: mujoco.MjModel, data: mujoco.MjData) -> _Array:
    """Return the torque or force on each degree of freedom for a force of 1 of each actuator."""
    outputs = np.zeros((len(data.moment_rownnz), model.nv))
    mujoco.mju_sparse2dense(
        *(outputs, data.actuator_moment, data.moment_rownnz, data.moment_rowadr), data.moment_colind
    )
    ends = zip(model.actuator_outadr, model.actuator_outnum, strict=True)
    return np.array([np.abs(outputs[at : at + n]).max(axis=0, initial=0.0) for at, n in ends])


def _force(model: mujoco.MjModel, actuator: int) -> float:
    """Return the force of an actuator for a control of 1, N or N·m.

    A negative peak force of a muscle is derived from its scale and the inertia that it moves.
    """
    gain = model.actuator_gainprm[actuator]
    if model.actuator_gaintype[actuator] != mujoco.mjtGain.mjGAIN_MUSCLE:
        return abs(float(gain[0]))
    moved = max(float(model.actuator_acc0[actuator]), _NO_MOMENT)
    return float(gain[2]) if gain[2] >= 0.0 else float(gain[3]) / moved


def _limb_numbers(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    joint: int,
    bodies: list[int],
    trunk: int,
    strength: float,
) -> tuple[float, ...]:
    body, dof = int(model.jnt_bodyid[joint]), int(model.jnt_dofadr[joint])
    into_trunk = data.xmat[trunk].reshape(3, 3).T
    anchor: _Array = data.xanchor[joint]
    end, _ = _farthest(model, data, bodies, anchor)
    limited = bool(model.jnt_limited[joint])
    depth, above = 0, body
    while above:
        depth += int(above != trunk and model.body_jntnum[above] > 0)
        above = int(model.body_parentid[above])
    numbers = (
        *_direction_and_length(into_trunk @ (anchor - data.xpos[trunk])),
        *(into_trunk @ data.xaxis[joint]),
        *_direction_and_length(into_trunk @ end),
        *(_decades(model.body_mass[bodies].sum()), _decades(model.body_subtreemass[body])),
        *(data.qpos[model.jnt_qposadr[joint]], *(model.jnt_range[joint] if limited else (0, 0))),
        math.log10(1.0 + strength) / 2.0,
        math.log10(1.0 + model.dof_damping[dof]),
        math.log10(1.0 + model.dof_armature[dof]),
        *(limited, model.jnt_type[joint] == _J.mjJNT_SLIDE, depth),
    )
    return tuple(map(float, numbers))


def _actuators_by_joint(
    model: mujoco.MjModel, moments: _Array, joints: list[int], owner: dict[int, int | None]
) -> dict[int, int]:
    """Return the actuator that moves each joint; see `Limb.actuator`."""
    to_joint = np.isin(model.actuator_trntype, [int(kind) for kind in OF_JOINTS])
    targets: list[int] = model.actuator_trnid[:, 0].tolist()
    found = {targets[actuator]: actuator for actuator in np.flatnonzero(to_joint).tolist()}
    for actuator in np.flatnonzero(~to_joint).tolist():
        free = {j: moments[actuator, model.jnt_dofadr[j]] for j in joints if j not in found}
        most, joint = max(free.values(), default=0.0), None
        if most > _NO_MOMENT:
            joint = next(j for j, moment in free.items() if moment > (1.0 - _EQUAL) * most)
        elif model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_BODY:
            joint = owner[targets[actuator]]  # Adhesion moves its body only in contact.
        if joint is not None:
            found.setdefault(joint, actuator)
    return found


def _farthest(
    model: mujoco.MjModel, data: mujoco.MjData, bodies: list[int], point: _Array
) -> tuple[_Array, float]:
    """Return the vector from a point to the farthest end of some bodies' geoms, and its length."""
    way, length = np.zeros(3), 0.0
    for geom in np.flatnonzero(np.isin(model.geom_bodyid, bodies)):
        kind = int(model.geom_type[geom])
        if kind in GROUND:
            continue
        # Capsules and cylinders end on their own z axis; other shapes at their bounding sphere.
        half = data.geom_xmat[geom].reshape(3, 3)[:, 2] * model.geom_size[geom, 1] * (kind in _LONG)
        more = 0.0 if kind in _LONG else float(model.geom_rbound[geom])
        for side in (1.0, -1.0):
            to_end = data.geom_xpos[geom] + side * half - point
            reach = float(np.linalg.norm(to_end)) + more
            if reach > length:
                way, length = to_end, reach
    return way, length


def _direction_and_length(vector: _Array) -> tuple[float, ...]:
    length = float(np.linalg.norm(vector))
    return (*(vector / max(length, 1e-9)), length)


def _decades(mass_kg: float) -> float:
    """Return the decades of a mass above 1 kg; -3 for less than a gram."""
    return math.log10(max(mass_kg, 1e-3))
