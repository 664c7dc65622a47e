"""Edits of joints: their range, and locking them."""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.edits.edit import Edit, part_of_the_way
from shapechanger.morphology.spec.elements import delete_joint, select
from shapechanger.morphology.spec.geometry import orientation, rotation

_J = mujoco.mjtJoint
# A joint without limits turns all the way round; a slide without limits has no such number.
_FULL_TURN: Final = (-math.pi, math.pi)
# MuJoCo needs a range above zero; that of a partly locked joint is at least this.
_NARROWEST_RAD: Final = 1e-3


class JointRange(Edit, frozen=True):
    """Change how far hinges and slides move; a joint without limits becomes limited.

    A slide without limits needs both. At a smaller amount, its limits are farther apart.

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
            old = limits(joint)
            if old is None:
                old = self._far_limits(joint)
            new = [
                o if n is None else part_of_the_way(o, n, self.amount)
                for o, n in zip(old, (self.lower, self.upper), strict=True)
            ]
            if not new[0] < new[1]:
                raise MorphologyError(
                    f"The range of {joint.name!r} would be {new[0]:.4g} to {new[1]:.4g}."
                )
            set_limits(joint, *new)

    def _far_limits(self, joint: mujoco.MjsJoint) -> tuple[float, float]:
        """Return limits for a slide without limits: the smaller the amount, the wider.

        Raises:
            MorphologyError: If the edit gives one limit only.
        """
        if self.lower is None or self.upper is None:
            raise MorphologyError(f"{joint.name!r} slides without limits: give both of them.")
        reach = (self.upper - self.lower) / self.amount
        return self.lower - reach, self.upper + reach


class Lock(Edit, frozen=True):
    """Lock hinges or slides at a position: remove the joints and their motors, keep the limbs.

    Both spaces shrink, so a policy needs a body map to be transferred; the rule `hold` of the map
    presents the locked position to the policy.

    Attributes:
        joint: Name or glob of the joints.
        position: Position at which it is locked, rad or m; None for the middle of its range.
    """

    joint: str
    position: float | None = None

    def check(self) -> None:
        """Refuse a position that is not a finite number."""
        if self.position is not None and not math.isfinite(self.position):
            raise MorphologyError(f"A joint cannot be locked at {self.position}.")

    def apply(self, spec: mujoco.MjSpec) -> None:
        """Lock every joint that fits."""
        for joint in select("joint", self.joint, spec.joints):
            old = limits(joint)
            position = self.position
            if position is None:
                if old is None:
                    raise MorphologyError(
                        f"{joint.name!r} slides without limits, so it has no middle: "
                        "give a position."
                    )
                position = 0.5 * (old[0] + old[1])
            if self.amount == 1.0:
                _weld(spec, joint, position)
                continue
            far = 1.0 / self.amount
            lower, upper = old or (position - far, position + far)
            narrow = max(1.0 - self.amount, _NARROWEST_RAD / (upper - lower))
            set_limits(
                joint,
                position + narrow * (lower - position),
                position + narrow * (upper - position),
            )


def limits(joint: mujoco.MjsJoint) -> tuple[float, float] | None:
    """The range of a hinge or slide, rad or m.

    Returns:
        A full turn for a hinge without limits, None for a slide without.

    Raises:
        MorphologyError: For other joints.
    """
    if joint.type not in (_J.mjJNT_HINGE, _J.mjJNT_SLIDE):
        raise MorphologyError(f"{joint.name!r} is neither a hinge nor a slide, so it has no range.")
    lower, upper = (float(x) for x in joint.range)
    automatic = joint.limited == mujoco.mjtLimited.mjLIMITED_AUTO and lower < upper
    if joint.limited != mujoco.mjtLimited.mjLIMITED_TRUE and not automatic:
        return None if joint.type == _J.mjJNT_SLIDE else _FULL_TURN
    if _in_degrees(joint):
        return math.radians(lower), math.radians(upper)
    return lower, upper


def set_limits(joint: mujoco.MjsJoint, lower: float, upper: float) -> None:
    """Limit the range of a hinge or slide.

    Args:
        joint: The joint.
        lower: Lower limit, rad or m.
        upper: Upper limit, rad or m.
    """
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    in_degrees = _in_degrees(joint)
    joint.range = [_degrees(x) if in_degrees else x for x in (lower, upper)]


def _in_degrees(joint: mujoco.MjsJoint) -> bool:
    """Return whether the model writes this joint's angles in degrees."""
    return bool(joint.compiler.degree) and joint.type == _J.mjJNT_HINGE


def _degrees(angle: float) -> float:
    """Return degrees that MuJoCo converts to exactly `angle`, rad, if possible.

    It is for every angle that was written in degrees: 30° is not 29.999999999999996°.
    """
    near = math.degrees(angle)
    candidates = (round(near, 9), near, math.nextafter(near, 0.0), math.nextafter(near, 2.0 * near))
    return next((degrees for degrees in candidates if math.radians(degrees) == angle), near)


def _weld(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, position: float) -> None:
    """Add the joint's displacement at `position` to its body's pose, and delete the joint."""
    body = joint.parent
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    reference = math.radians(joint.ref) if _in_degrees(joint) else float(joint.ref)
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
    delete_joint(spec, joint)
