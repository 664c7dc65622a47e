"""Running two models side by side, to the last bit."""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.collisions import colliding_pairs

__all__ = ["moves_equally"]

# What the two data must agree on after every step; all that a step leaves for the next is in it.
_FIELDS: Final = (
    *("time", "qpos", "qvel", "act", "qacc", "qacc_warmstart", "qfrc_constraint", "xpos", "xquat"),
    *(
        "qfrc_passive",
        "qfrc_spring",
        "qfrc_damper",
        "geom_xpos",
        "cinert",
        "cvel",
        "cfrc_ext",
        "cfrc_int",
        "cacc",
        "actuator_force",
        "sensordata",
    ),
)
_OF_CONTACTS: Final = (
    *("geom", "dist", "pos", "frame", "includemargin", "friction", "solref", "solreffriction"),
    *("solimp", "dim", "exclude", "efc_address"),
)
# Starts from the model's own pose and from drawn ones, and steps from each.
_STARTS: Final = 6
_STEPS: Final = 8
_SEED: Final = 20170706
# Part of a joint's range, or rad and m where it has none, by which the drawn poses differ; and the
# velocities, rad/s and m/s.
_POSE_NOISE: Final = 0.5
_SPEED: Final = 3.0
# How deep below the floor the trunk is put, so that every geom touches it, m.
_SUNK_M: Final = 0.02


def moves_equally(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether two models move equally, to the last bit, from a few starts.

    Some starts hang free; in others the trunk is thrown, turned over or sunk into the floor, so
    that geoms touch it and joints are pressed into their limits. Every pair that can collide must
    have touched where the search for contacts differs.
    """
    rng = np.random.default_rng(_SEED)
    one, two = mujoco.MjData(model), mujoco.MjData(model)
    touched: set[tuple[int, int]] = set()
    for start in range(_STARTS):
        pose, speed = _drawn(model, rng, start)
        for data in (one, two):
            mujoco.mj_resetData(model, data)
            data.qpos[:] = pose
            data.qvel[:] = speed
            mujoco.mj_forward(model, data)  # As at a reset: by the original.
        for _ in range(_STEPS):
            action = rng.uniform(-1.0, 1.0, model.nu)
            one.ctrl[:] = two.ctrl[:] = action
            mujoco.mj_step(model, one)
            mujoco.mj_step(other, two)
            mujoco.mj_rnePostConstraint(model, one)
            mujoco.mj_rnePostConstraint(other, two)
            if not _same(one, two):
                return False
            touched.update((int(a), int(b)) for a, b in one.contact.geom)
    if other.npair == model.npair:
        return True
    _, pairs = colliding_pairs(model)
    return {(int(a), int(b)) for a, b in pairs} <= touched | {(b, a) for a, b in touched}


def _same(one: mujoco.MjData, two: mujoco.MjData) -> bool:
    if one.ncon != two.ncon or one.nefc != two.nefc:
        return False
    return all(_equal(getattr(one, name), getattr(two, name)) for name in _FIELDS) and all(
        _equal(getattr(one.contact, name), getattr(two.contact, name)) for name in _OF_CONTACTS
    )


def _equal(one: Any, two: Any) -> bool:
    return np.asarray(one).tobytes() == np.asarray(two).tobytes()


def _drawn(
    model: mujoco.MjModel, rng: np.random.Generator, start: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A pose (nq,) and velocities (nv,) to start from."""
    speed = _SPEED * rng.standard_normal(model.nv)
    if start == 0:
        return model.qpos0.copy(), np.zeros(model.nv)
    pose = model.qpos0.copy()
    for joint in range(model.njnt):
        at = int(model.jnt_qposadr[joint])
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            if start % 2:  # Sunk: every geom that lies about level with the trunk touches.
                pose[at + 2] = -_SUNK_M * start
            else:
                pose[at + 2] = 0.4
                pose[at + 3 : at + 7] = rng.standard_normal(4)
        elif model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_BALL:
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-1.0, 1.0)
            pose[at] += rng.uniform(-_POSE_NOISE, _POSE_NOISE) * (high - low)
    mujoco.mj_normalizeQuat(model, pose)
    return pose, speed
