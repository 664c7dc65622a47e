"""Joints and actuators: limits, references, bodies at another position, motors and strengths."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import require_free_name
from shapechanger.morphology.spec.geometry import (
    UPRIGHT,
    Array,
    orientation,
    product,
    rotation,
    set_orientation,
)
from shapechanger.morphology.spec.references import key_of, references

_J: Final = mujoco.mjtJoint
_GAIN: Final = mujoco.mjtGain
_BIAS: Final = mujoco.mjtBias
# A joint without limits turns all the way round; a slide without limits has no such number.
_FULL_TURN: Final = (-math.pi, math.pi)
_LINEAR: Final = (_GAIN.mjGAIN_FIXED, _GAIN.mjGAIN_AFFINE), (_BIAS.mjBIAS_NONE, _BIAS.mjBIAS_AFFINE)


# --- Positions ---------------------------------------------------------------------------------


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
    """Limit the range of a hinge or slide, rad or m."""
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    joint.range = [_as_written(joint, lower), _as_written(joint, upper)]


def reference_of(joint: mujoco.MjsJoint) -> float:
    """Return the position of a hinge or slide in the model's own pose, rad or m."""
    return math.radians(joint.ref) if _in_degrees(joint) else float(joint.ref)


def set_reference(joint: mujoco.MjsJoint, position: float) -> None:
    """Set the position of a hinge or slide in the model's own pose, rad or m; the pose stays."""
    joint.ref = _as_written(joint, position)


def _in_degrees(joint: mujoco.MjsJoint) -> bool:
    return bool(joint.compiler.degree) and joint.type == _J.mjJNT_HINGE


def _as_written(joint: mujoco.MjsJoint, position: float) -> float:
    """Return a position, rad or m, in the unit of the model.

    MuJoCo converts degrees to exactly this angle if possible, as for every angle that was written
    in degrees: 30° is not 29.999999999999996°.
    """
    if not _in_degrees(joint):
        return position
    near = math.degrees(position)
    candidates = (round(near, 9), near, math.nextafter(near, 0.0), math.nextafter(near, 2.0 * near))
    return next((degrees for degrees in candidates if math.radians(degrees) == position), near)


def displace(joint: mujoco.MjsJoint, by: float | Array) -> None:
    """Change the pose of a joint's body as if the joint had moved.

    Args:
        joint: A hinge, slide or ball.
        by: Angle, rad, or distance, m; of a ball, the turn as a quaternion (w, x, y, z).
    """
    body, quaternion = joint.parent, UPRIGHT.copy()
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    if joint.type == _J.mjJNT_BALL:
        quaternion = np.array(by)
    elif joint.type == _J.mjJNT_HINGE:
        mujoco.mju_axisAngle2Quat(quaternion, axis, float(by))
    turn = rotation(quaternion)
    shift = axis * by if joint.type == _J.mjJNT_SLIDE else joint.pos - turn @ joint.pos
    # The body's joints act in order; those before this one are now seen from the turned frame.
    for earlier in body.joints[: [j.name for j in body.joints].index(joint.name)]:
        earlier.axis = turn.T @ earlier.axis
        earlier.pos = turn.T @ (earlier.pos - shift)
    parent = orientation(body)
    body.pos = body.pos + rotation(parent) @ shift
    set_orientation(body, product(parent, quaternion))


# --- Strengths ---------------------------------------------------------------------------------


def add_motor(spec: mujoco.MjSpec, name: str, gear: float) -> None:
    """Add a motor to the joint of its name; its gear is the N·m or N for a control of 1."""
    require_free_name(spec, "actuator", name)
    motor = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        ctrlrange=[-1.0, 1.0],
        gear=[gear, 0.0, 0.0, 0.0, 0.0, 0.0],
    )
    motor.set_to_motor()


def is_motor(actuator: mujoco.MjsActuator) -> bool:
    """Return whether the force does not depend on where the actuator is: gain times control."""
    return actuator.gaintype == _GAIN.mjGAIN_FIXED and actuator.biastype == _BIAS.mjBIAS_NONE


def scale_strength(actuator: mujoco.MjsActuator, factor: float) -> None:
    """Scale the force of an actuator; a servo keeps its targets, and a muscle its lengths.

    The gear of a motor scales. The gear of any other actuator also scales what it measures, so of a
    servo the gains, the bias and the force range scale instead.

    Raises:
        MorphologyError: If the actuator's gains have no common scale.
    """
    if is_motor(actuator):
        actuator.gear = actuator.gear * factor
        return
    gain, bias = np.array(actuator.gainprm), np.array(actuator.biasprm)
    if actuator.gaintype == _GAIN.mjGAIN_MUSCLE and actuator.biastype == _BIAS.mjBIAS_MUSCLE:
        # The peak force, and what it is derived from where it is negative.
        for force in (gain[2:4], bias[2:4]):
            force[force > 0.0] *= factor
    elif actuator.gaintype in _LINEAR[0] and actuator.biastype in _LINEAR[1]:
        # Constant, length and velocity terms.
        gain[:3] *= factor
        bias[:3] *= factor
    else:
        raise MorphologyError(
            f"{actuator.name!r} is an actuator whose gains have no common scale, so its strength "
            "cannot be scaled: write new gains into the model instead."
        )
    actuator.gainprm, actuator.biasprm = gain, bias
    actuator.forcerange = actuator.forcerange * factor


def scale_clamps(spec: mujoco.MjSpec, factors: Mapping[str, float]) -> None:
    """Scale the largest force of the joints and tendons whose actuators have all become as strong.

    Without it, a stronger motor of a joint with `actuatorfrcrange` would change nothing. The
    factors are new forces over old ones, by the names of actuators.
    """
    driven = [(each.element, each.holder.name) for each in references(spec, "actuator")]
    for element in (*spec.joints, *spec.tendons):
        scales = {factors.get(name, 1.0) for target, name in driven if target == key_of(element)}
        if len(scales) == 1 and np.any(element.actfrcrange):
            element.actfrcrange = element.actfrcrange * abs(scales.pop())


def scale_resistance(element: Any, factor: float) -> None:
    """Scale the armature, damping, stiffness and friction of a joint or tendon."""
    for field in ("armature", "damping", "stiffness", "frictionloss"):
        setattr(element, field, getattr(element, field) * factor)
