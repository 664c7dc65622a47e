"""Find cheaper models whose motion is bit-equal to the original model.

Four parts of MuJoCo's step take time without changing any number of an ant or a single pendulum:

- **Islands.** The solver splits the constraints into islands that do not touch. One tree of bodies
  has at most one island, so skipping the search gives the same sums in the same order.
- **Contact search.** The possible contacts of one floor and a few geoms are known beforehand.
  Explicit pairs, in the order of the search and with the parameters that it would mix, give the
  same contacts. The margin of a pair is the sum of its geoms' margins.
- **Collisions** of models without possible collisions, such as a pendulum.
- **Springs, joint friction, sensors and equalities** of a model that has none.

Two checks decide whether these parts are left out: rules on the model, which keep every pair that
the original could ever generate, and then a test that steps both models side by side. If either
check fails, there is no fast model.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any, Final, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.certificate.numbers import (
    colliding_pairs,
    geoms_of_pairs,
    mixed_parameters,
)

_BIT: Final = mujoco.mjtDisableBit
# Elements that could split one tree into islands, or that the rules do not cover.
_UNKNOWN: Final = ("neq", "ntendon", "nflex", "nplugin", "nmocap", "nskin", "nhfield", "npair")


def find_fast_model(
    model: mujoco.MjModel, make_spec: Callable[[], mujoco.MjSpec]
) -> mujoco.MjModel | None:
    """Return a cheaper model that steps the data of a model with equal motion, or None.

    The model is unedited, and `make_spec` returns the spec from which it was compiled.
    """
    # Refused models may have constraints in several trees, or elements without a rule here.
    if (
        model.ntree != 1
        or model.opt.enableflags
        or any(getattr(model, size) for size in _UNKNOWN)
        or mujoco.get_mjcb_contactfilter() is not None
    ):
        return None
    _, pairs = colliding_pairs(model)
    fast = _with_pairs(model, make_spec(), pairs) if pairs.size else copy.copy(model)
    if fast is None:
        return None
    flags = [_BIT.mjDSBL_ISLAND, _BIT.mjDSBL_MIDPHASE, _BIT.mjDSBL_EQUALITY]
    if not pairs.size:
        flags.append(_BIT.mjDSBL_CONTACT)
    # If both springs and dampers are disabled, MuJoCo skips all other passive forces too, such as
    # fluid forces.
    has_dampers = not model.opt.disableflags & int(_BIT.mjDSBL_DAMPER)
    if has_dampers and not (model.jnt_stiffness.any() or model.jnt_stiffnesspoly.any()):
        flags.append(_BIT.mjDSBL_SPRING)
    if not model.dof_frictionloss.any():
        flags.append(_BIT.mjDSBL_FRICTIONLOSS)
    if not model.nsensor:
        flags.append(_BIT.mjDSBL_SENSOR)
    fast.opt.disableflags |= sum(map(int, flags))
    return fast if moves_equally(model, fast) else None


def _with_pairs(
    model: mujoco.MjModel, spec: mujoco.MjSpec, pairs: NDArray[np.int64]
) -> mujoco.MjModel | None:
    """Return the model with all possible contacts as explicit pairs, and without a search.

    The result is None unless all pairs join the same fixed geom with a different body each: the
    order of the pairs then follows from the order of the bodies.
    """
    names = [model.geom(geom).name for geom in range(model.ngeom)]
    bodies, involved = model.geom_bodyid[pairs], np.unique(pairs)
    fixed = model.body_weldid[bodies] == 0
    moving = bodies[~fixed]
    if not (
        all(names)
        and (fixed.sum(axis=1) == 1).all()
        and np.unique(pairs[fixed]).size == 1
        and np.unique(moving).size == moving.size
        and np.unique(model.geom_priority[involved]).size == 1
        and not model.geom_adhesion[involved].any()
        and not model.geom_surfacevel[involved].any()
    ):
        return None
    for first, second in pairs.tolist():
        cast("Any", spec).add_pair(geomname1=names[first], geomname2=names[second])
    result = spec.compile()
    for name in dir(model):  # Only names and pairs may differ.
        value = getattr(model, name)
        is_array = type(value) is np.ndarray and not name.startswith(("pair_", "name", "_"))
        if is_array and not np.array_equal(value, getattr(result, name)):
            return None
    for parameter, values in mixed_parameters(result, geoms_of_pairs(result)).items():
        getattr(result, f"pair_{parameter}")[:] = values
    # Exclude all geoms from the search, using their bits and the bits of their bodies.
    result.geom_contype[:] = result.geom_conaffinity[:] = 0
    result.body_contype[:] = result.body_conaffinity[:] = 0
    return result


# Fields that must be equal after every step; they include everything that the next step uses.
_FIELDS: Final = (
    *("time", "qpos", "qvel", "act", "qacc", "qacc_warmstart", "qfrc_constraint", "xpos", "xquat"),
    *("qfrc_passive", "geom_xpos", "cinert", "cvel", "cfrc_ext", "cfrc_int", "cacc", "sensordata"),
    *("actuator_force", "ncon", "nefc"),
)
_OF_CONTACTS: Final = (
    *("geom", "dist", "pos", "frame", "includemargin", "friction", "solref", "solreffriction"),
    *("solimp", "dim", "exclude", "efc_address"),
)
# Number of starts, the first from the model's own pose, and of steps from each.
_STARTS: Final = 6
_STEPS: Final = 8
_SEED: Final = 20170706
# Largest shift in random poses, as a fraction of a joint's range, which is 2 rad or m for a joint
# without limits; and standard deviation of velocities, rad/s and m/s.
_POSE: Final = 0.5
_SPEED: Final = 3.0
# Depth of a sunk trunk below the floor, m, times the start's number; and height of a throw, m.
_SUNK_M: Final = 0.02
_THROWN_M: Final = 0.4


def moves_equally(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Return whether two models move equally, to the last bit, from several starts.

    In some starts a free trunk is thrown and turned over, in others sunk into the floor, so that
    geoms touch it and joints reach their limits. Every pair that can collide must have touched.
    """
    rng = np.random.default_rng(_SEED)
    one, two = mujoco.MjData(model), mujoco.MjData(model)
    touched: set[tuple[int, ...]] = set()
    axes = model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE)  # Slides and hinges.
    for start in range(_STARTS):
        pose, speed = model.qpos0.copy(), np.zeros(model.nv)
        if start:
            speed = _SPEED * rng.standard_normal(model.nv)
            spans = np.where(model.jnt_limited[axes], np.ptp(model.jnt_range[axes], axis=1), 2.0)
            pose[model.jnt_qposadr[axes]] += spans * rng.uniform(-_POSE, _POSE, spans.size)
            for at in model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]:
                if start % 2:  # Sunk: every geom at the height of the trunk touches the floor.
                    pose[at + 2] = -_SUNK_M * start
                else:
                    pose[at + 2 : at + 7] = _THROWN_M, *rng.standard_normal(4)
            mujoco.mj_normalizeQuat(model, pose)
        for data in (one, two):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = pose, speed
            mujoco.mj_forward(model, data)  # With the original model, like a reset.
        for _ in range(_STEPS):
            action = rng.uniform(-1.0, 1.0, model.nu)
            for stepping, data in ((model, one), (other, two)):
                data.ctrl[:] = action
                mujoco.mj_step(stepping, data)
                mujoco.mj_rnePostConstraint(stepping, data)
            if _bits(one) != _bits(two):
                return False
            touched |= _sorted(one.contact.geom)
    return touched >= _sorted(colliding_pairs(model)[1])


def _bits(data: Any) -> list[bytes]:
    parts = (data, _FIELDS), (data.contact, _OF_CONTACTS)
    return [np.asarray(getattr(one, name)).tobytes() for one, names in parts for name in names]


def _sorted(pairs: Any) -> set[tuple[int, ...]]:
    """Return pairs of geoms, (n, 2), each in ascending order."""
    return {tuple(pair) for pair in cast("list[list[int]]", np.sort(pairs).tolist())}
