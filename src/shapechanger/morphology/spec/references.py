"""Taking a joint away with all that refers to it.

MuJoCo does so for a body, but not for a joint: what names it would be left behind and not compile.
"""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError

__all__ = ["delete_joint"]

_OF_JOINTS: Final = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)


def delete_joint(spec: mujoco.MjSpec, joint: mujoco.MjsJoint) -> None:
    """Delete a joint, its motors and couplings, the sensors of these, and all keyframes.

    A keyframe lists every joint, so none would fit any more.

    Raises:
        MorphologyError: If a tendon ties the joint to others.
    """
    name = joint.name
    for tendon in list(spec.tendons):
        if name in _joints_of(tendon):
            if _does_something(spec, tendon):
                raise MorphologyError(
                    f"{name!r} is tied to other joints by the tendon {tendon.name!r}, so it cannot "
                    "be taken away alone."
                )
            spec.delete(tendon)
    for actuator in list(spec.actuators):
        if actuator.trntype in _OF_JOINTS and actuator.target == name:
            _delete_sensors(spec, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator.name)
            spec.delete(actuator)
    for equality in list(spec.equalities):
        if equality.type == mujoco.mjtEq.mjEQ_JOINT and name in (equality.name1, equality.name2):
            spec.delete(equality)
    _delete_sensors(spec, mujoco.mjtObj.mjOBJ_JOINT, name)
    for key in list(spec.keys):
        spec.delete(key)
    spec.delete(joint)


def _delete_sensors(spec: mujoco.MjSpec, kind: mujoco.mjtObj, name: str) -> None:
    """Delete the sensors of one element."""
    for sensor in list(spec.sensors):
        if sensor.objtype == kind and sensor.objname == name:
            spec.delete(sensor)


def _joints_of(tendon: mujoco.MjsTendon) -> set[str]:
    """The names of the joints whose positions a fixed tendon adds up; none for a spatial one."""
    wraps = (tendon.path[i] for i in range(len(tendon.path)))
    return {wrap.target.name for wrap in wraps if wrap.type == mujoco.mjtWrap.mjWRAP_JOINT}


def _does_something(spec: mujoco.MjSpec, tendon: mujoco.MjsTendon) -> bool:
    """Whether a tendon acts on its joints or is read: the humanoid's do neither."""
    lower, upper = tendon.range
    automatic = tendon.limited == mujoco.mjtLimited.mjLIMITED_AUTO and lower < upper
    acts = np.any(tendon.stiffness) or np.any(tendon.damping) or tendon.frictionloss
    if tendon.limited == mujoco.mjtLimited.mjLIMITED_TRUE or automatic or acts or tendon.armature:
        return True
    used = {a.target for a in spec.actuators if a.trntype == mujoco.mjtTrn.mjTRN_TENDON}
    used |= {s.objname for s in spec.sensors if s.objtype == mujoco.mjtObj.mjOBJ_TENDON}
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_TENDON:
            used |= {equality.name1, equality.name2}
    return bool(tendon.name) and tendon.name in used
