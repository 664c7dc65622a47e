"""Positions of joints: their limits, their reference, and bodies at another position of a joint."""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.geometry import Array, orientation, rotation

_J: Final = mujoco.mjtJoint
# A joint without limits turns all the way round; a slide without limits has no such number.
_FULL_TURN: Final = (-math.pi, math.pi)


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


def reference_of(joint: mujoco.MjsJoint) -> float:
    """Return the position of a hinge or slide in the model's own pose, rad or m."""
    return math.radians(joint.ref) if _in_degrees(joint) else float(joint.ref)


def set_reference(joint: mujoco.MjsJoint, position: float) -> None:
    """Set the position of a hinge or slide in the model's own pose; the pose itself stays.

    Args:
        joint: The joint.
        position: The position, rad or m.
    """
    joint.ref = _degrees(position) if _in_degrees(joint) else position


def displace(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, by: float | Array) -> None:
    """Change the pose of a joint's body as if the joint had moved.

    Args:
        spec: Specification that contains it.
        joint: A hinge, slide or ball.
        by: Angle, rad, or distance, m; of a ball, the turn as a quaternion (w, x, y, z).
    """
    body = joint.parent
    turn, shift = np.eye(3), np.zeros(3)
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    if joint.type == _J.mjJNT_SLIDE:
        shift = np.array(joint.axis) / np.linalg.norm(joint.axis) * by
    else:
        if joint.type == _J.mjJNT_BALL:
            quaternion = np.array(by)
        else:
            axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
            mujoco.mju_axisAngle2Quat(quaternion, axis, float(by))
        turn = rotation(quaternion)
        shift = joint.pos - turn @ joint.pos
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
