"""Edits of joints: their range, and locking them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edit import Edit, part_of_the_way
from shapechanger.morphology.elements import select
from shapechanger.morphology.segments import orientation, rotation

if TYPE_CHECKING:
    pass

__all__ = ["JointRange", "Lock"]

_J = mujoco.mjtJoint
# A joint without limits turns all the way round; a slide without limits has no such number.
_FULL_TURN: Final = (-math.pi, math.pi)
# MuJoCo needs a range wider than nothing; that of a joint on its way to a lock is at least this.
_NARROWEST_RAD: Final = 1e-3


class JointRange(Edit, frozen=True):
    """Change how far hinges and slides move; a joint without limits becomes limited.

    Attributes:
        joint: Name or glob of the joints.
        lower: New lower limit, rad or m; None keeps the old one.
        upper: New upper limit, rad or m; None keeps the old one.
    """

    joint: str
    lower: float | None = None
    upper: float | None = None

    def check(self) -> None:
        """Refuse an empty range, or none at all."""
        limits = [x for x in (self.lower, self.upper) if x is not None]
        if not limits or not all(math.isfinite(x) for x in limits):
            raise MorphologyError(f"A joint range needs a finite lower or upper limit, got {self}.")
        if self.lower is not None and self.upper is not None and not self.lower < self.upper:
            raise MorphologyError(f"The lower limit must be below the upper one, got {self}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Change every joint that fits."""
        for joint in select("joint", self.joint, spec.joints):
            old = limits(spec, joint)
            new = [
                o if n is None else part_of_the_way(o, n, self.amount)
                for o, n in zip(old, (self.lower, self.upper), strict=True)
            ]
            if not new[0] < new[1]:
                raise MorphologyError(
                    f"The range of {joint.name!r} would be {new[0]:.4g} to {new[1]:.4g}."
                )
            set_limits(spec, joint, *new)


class Lock(Edit, frozen=True):
    """Lock hinges or slides at a position: the joint and its motors go, the limb stays.

    Both spaces shrink, so a policy needs a body map to cross over; its rule `hold` keeps for the
    policy the angle at which the joint is locked.

    Attributes:
        joint: Name or glob of the joints.
        position: Where it is locked, rad or m; None for the middle of its range.
    """

    joint: str
    position: float | None = None

    def check(self) -> None:
        """Refuse a position that is no number."""
        if self.position is not None and not math.isfinite(self.position):
            raise MorphologyError(f"A joint cannot be locked at {self.position}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Lock every joint that fits."""
        for joint in select("joint", self.joint, spec.joints):
            lower, upper = limits(spec, joint)
            position = 0.5 * (lower + upper) if self.position is None else self.position
            if self.amount == 1.0:
                _weld(spec, joint, position)
                continue
            narrow = max(1.0 - self.amount, _NARROWEST_RAD / (upper - lower))
            set_limits(
                spec,
                joint,
                position + narrow * (lower - position),
                position + narrow * (upper - position),
            )


def limits(spec: mujoco.MjSpec, joint: mujoco.MjsJoint) -> tuple[float, float]:
    """The range of a hinge or slide, rad or m; a full turn for a hinge without limits.

    Raises:
        MorphologyError: For other joints, and for a slide without limits.
    """
    if joint.type not in (_J.mjJNT_HINGE, _J.mjJNT_SLIDE):
        raise MorphologyError(f"{joint.name!r} is no hinge and no slide, so it has no range.")
    lower, upper = (float(x) for x in joint.range)
    automatic = joint.limited == mujoco.mjtLimited.mjLIMITED_AUTO and lower < upper
    if joint.limited != mujoco.mjtLimited.mjLIMITED_TRUE and not automatic:
        if joint.type == _J.mjJNT_SLIDE:
            raise MorphologyError(f"{joint.name!r} slides without limits: give both of them.")
        return _FULL_TURN
    if _in_degrees(spec, joint):
        return math.radians(lower), math.radians(upper)
    return lower, upper


def set_limits(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, lower: float, upper: float) -> None:
    """Limit a hinge or slide to `lower` ... `upper`, rad or m."""
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    in_degrees = _in_degrees(spec, joint)
    joint.range = [math.degrees(x) if in_degrees else x for x in (lower, upper)]


def _in_degrees(spec: mujoco.MjSpec, joint: mujoco.MjsJoint) -> bool:
    """Whether the model writes this joint's angles in degrees."""
    return bool(spec.compiler.degree) and joint.type == _J.mjJNT_HINGE


def _weld(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, position: float) -> None:
    """Move the joint's displacement at `position` into its body's pose, and delete the joint."""
    body = joint.parent
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    reference = math.radians(joint.ref) if _in_degrees(spec, joint) else float(joint.ref)
    displacement = position - reference
    turn, shift = np.eye(3), np.zeros(3)
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    if joint.type == _J.mjJNT_HINGE:
        mujoco.mju_axisAngle2Quat(quaternion, axis, displacement)
        turn = rotation(quaternion)
        shift = joint.pos - turn @ joint.pos
    else:
        shift = axis * displacement
    # The body's joints act in order; those before this one are now seen from the turned frame.
    for earlier in body.joints[: [j.name for j in body.joints].index(joint.name)]:
        earlier.axis = turn.T @ earlier.axis
        earlier.pos = turn.T @ (earlier.pos - shift)
    parent = orientation(spec, body)
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, parent, quaternion)
    body.pos = body.pos + rotation(parent) @ shift
    body.quat = turned
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    for element in (*spec.actuators, *spec.sensors, *spec.equalities):
        if joint.name in _joints_of(element):
            spec.delete(element)
    spec.delete(joint)


def _joints_of(element: mujoco.MjsActuator | mujoco.MjsSensor | mujoco.MjsEquality) -> set[str]:
    """The names of the joints that an element acts on or reads."""
    if isinstance(element, mujoco.MjsActuator):
        joint_drives = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
        return {element.target} if element.trntype in joint_drives else set()
    if isinstance(element, mujoco.MjsSensor):
        return {element.objname} if element.objtype == mujoco.mjtObj.mjOBJ_JOINT else set()
    if element.type != mujoco.mjtEq.mjEQ_JOINT:
        return set()
    return {element.name1, element.name2}
