"""Names, units and ranges of the blocks of MuJoCo observations and actions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import mujoco

from shapechanger.layout import Element, Feature, Layout

_J = mujoco.mjtJoint
_POSITION_UNIT: Final = {_J.mjJNT_SLIDE: "m", _J.mjJNT_HINGE: "rad"}
_FORCE_UNIT: Final = {_J.mjJNT_SLIDE: "N", _J.mjJNT_HINGE: "N·m"}
# The quantities of each block of numbers of a body, with their units.
_OF_BODIES: Final = {
    "contact": {f"t{axis}": "N·m" for axis in "xyz"} | {f"f{axis}": "N" for axis in "xyz"},
    "inertia": {
        **dict.fromkeys(("xx", "yy", "zz", "xy", "xz", "yz"), "kg·m²"),
        **{"mx": "kg·m", "my": "kg·m", "mz": "kg·m", "mass": "kg"},
    },
    "twist": {f"w{axis}": "rad/s" for axis in "xyz"} | {f"v{axis}": "m/s" for axis in "xyz"},
}


def position_features(model: mujoco.MjModel) -> list[Feature]:
    """Return a feature for each number of qpos.

    `joint/angle` or `joint/position` for a hinge or slide; `body/x` ... `body/qz` for a free joint:
    place in the world, m, and orientation as a unit quaternion, which a ball joint has too. Limits
    of joints are soft: contact and motors can press a joint a little beyond them.
    """
    features: list[Feature] = []
    for kind, element, j in _joints(model):
        if unit := _POSITION_UNIT.get(kind):
            name = f"{element.name}/{'angle' if unit == 'rad' else 'position'}"
            low, high = model.jnt_range[j] if model.jnt_limited[j] else (-math.inf, math.inf)
            features.append(Feature(name, unit, float(low), float(high), element))
            continue
        if kind == _J.mjJNT_FREE:
            features += [Feature(f"{element.name}/{axis}", "m", element=element) for axis in "xyz"]
        features += [Feature(f"{element.name}/q{q}", "1", -1.0, 1.0, element) for q in "wxyz"]
    return features


def velocity_features(model: mujoco.MjModel, limit: float = math.inf) -> list[Feature]:
    """Return a feature for each number of qvel, with the range from `-limit` to `limit`.

    `joint/velocity` for a hinge or slide; `body/vx` ... `body/wz` for a free joint: velocity in the
    world's frame, m/s, and angular velocity in the body's, rad/s, which a ball joint has too.
    """
    features: list[Feature] = []
    for kind, element, _ in _joints(model):
        if unit := _POSITION_UNIT.get(kind):
            quantities = {"velocity": f"{unit}/s"}
        else:
            quantities = {f"v{axis}": "m/s" for axis in "xyz" if kind == _J.mjJNT_FREE}
            quantities |= {f"w{axis}": "rad/s" for axis in "xyz"}
        features += [
            Feature(f"{element.name}/{quantity}", unit, -limit, limit, element)
            for quantity, unit in quantities.items()
        ]
    return features


def body_features(
    model: mujoco.MjModel, block: str, low: float = -math.inf, high: float = math.inf
) -> list[Feature]:
    """Return features `body/block/quantity` of each body except the world, in world axes.

    - `contact` is MuJoCo's `cfrc_ext`: torques `tx` ... `tz`, N·m, and forces `fx` ... `fz`, N.
    - `inertia` is `cinert`: `xx` ... `yz`, the inertia about the centre of mass of the body's whole
      tree, kg·m²; `mx` to `mz`, the mass times its distance from there, kg·m; and `mass`, kg.
    - `twist` is `cvel`: the angular velocity `wx` ... `wz`, rad/s; and `vx` ... `vz`, the velocity
      at the centre of mass of the body's whole tree, m/s.
    """
    names = [model.body(b).name for b in range(1, model.nbody)]
    return [
        Feature(f"{name}/{block}/{quantity}", unit, low, high, Element("body", name))
        for name in names
        for quantity, unit in _OF_BODIES[block].items()
    ]


def drive_features(model: mujoco.MjModel) -> list[Feature]:
    """Return a feature `joint/drive` per hinge and slide: the motors' torque or force, N·m or N."""
    return [
        Feature(f"{element.name}/drive", _FORCE_UNIT[kind], element=element)
        for kind, element, _ in _joints(model)
        if kind in _FORCE_UNIT
    ]


def action_layout(model: mujoco.MjModel) -> Layout:
    """Return a feature per control.

    `actuator/motor` on a hinge or slide has a gain: gear times MuJoCo's `gainprm`, N·m or N per
    unit of control. `actuator/target` is the position or velocity to which a servo drives a joint.
    """
    features: list[Feature] = []
    for a in range(model.nu):
        name = model.actuator(a).name
        limited = bool(model.actuator_ctrllimited[a])
        low, high = model.actuator_ctrlrange[a] if limited else (-math.inf, math.inf)
        gear = float(model.actuator_gear[a, 0] * model.actuator_gainprm[a, 0])
        drives_joint = model.actuator_trntype[a] == mujoco.mjtTrn.mjTRN_JOINT
        kind = _J(model.jnt_type[model.actuator_trnid[a, 0]]) if drives_joint else None
        target = _servo_unit(model, a, kind)
        unit = _FORCE_UNIT.get(kind, "") if kind is not None and gear > 0.0 and not target else ""
        about = f"{name}/{'target' if target else 'motor'}", target or "1", float(low), float(high)
        gain = gear if unit else 1.0
        features.append(Feature(*about, Element("actuator", name), gain=gain, gain_unit=unit))
    return Layout(tuple(features))


def _servo_unit(model: mujoco.MjModel, actuator: int, kind: mujoco.mjtJoint | None) -> str:
    """Return the unit of the target of a servo on a hinge or slide; empty for other actuators."""
    # MuJoCo's shortcuts <position> and <velocity>, with a gear of 1.
    plain = (
        model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
        and model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_gear[actuator, 0] == 1.0
    )
    gain, bias = model.actuator_gainprm[actuator, 0], model.actuator_biasprm[actuator]
    if not plain or not gain or kind is None or kind not in _POSITION_UNIT:
        return ""
    if bias[1] == -gain:
        return _POSITION_UNIT[kind]
    return f"{_POSITION_UNIT[kind]}/s" if bias[1] == 0.0 and bias[2] == -gain else ""


def _joints(model: mujoco.MjModel) -> Iterator[tuple[mujoco.mjtJoint, Element, int]]:
    """Yield the kind, element and index of each joint; free and ball joints are named by body."""
    for j in range(model.njnt):
        kind, body = _J(model.jnt_type[j]), model.body(model.jnt_bodyid[j]).name
        is_axis = kind in _POSITION_UNIT
        yield kind, Element("joint", model.joint(j).name) if is_axis else Element("body", body), j
