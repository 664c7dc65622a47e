"""Find cheaper models whose motion is bit-equal to the original model.

Four parts of MuJoCo's step take time without changing any number of an ant or a pendulum:

- **Islands.** The solver splits the constraints into islands that do not touch. One tree of bodies
  has at most one island, so skipping the search gives the same sums in the same order.
- **Contact search.** The possible contacts of one floor and a few geoms are known beforehand.
  Explicit pairs, in the order of the search and with the parameters that it would mix, give the
  same contacts. Margins are *summed*.
- **Collisions** of models without possible collisions, such as a pendulum.
- **Springs, joint friction, sensors and equalities** of a model that has none.

Two checks decide which of these may be left out: rules on the model, which keep every pair that the
original could ever generate, and then a test that steps both models side by side. A model for which
either fails keeps its contact search, or has no fast model at all.
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

_Ints = NDArray[np.int64]

_BIT: Final = mujoco.mjtDisableBit
_NO_ISLANDS: Final = int(_BIT.mjDSBL_ISLAND)
_NO_SEARCH: Final = int(_BIT.mjDSBL_MIDPHASE)
_NO_CONTACTS: Final = int(_BIT.mjDSBL_CONTACT)
# Elements that could split one tree into islands, or that the rules do not cover.
_UNKNOWN: Final = ("neq", "ntendon", "nflex", "nplugin", "nmocap", "nskin", "nhfield")


def find_fast_model(
    model: mujoco.MjModel, make_spec: Callable[[], mujoco.MjSpec]
) -> mujoco.MjModel | None:
    """Return a cheaper model that steps the data of another and moves equally.

    Args:
        model: The compiled, unedited model.
        make_spec: Returns the spec that the model was compiled from.

    Returns:
        The fast model; None if none is known to move equally.
    """
    # Others may have constraints in several trees, or elements that the rules do not cover.
    if (
        model.ntree != 1
        or model.opt.enableflags
        or any(getattr(model, size) for size in _UNKNOWN)
        or mujoco.get_mjcb_contactfilter() is not None
    ):
        return None
    without_search = _without_search(model, make_spec)
    if without_search is not None and moves_equally(model, without_search):
        return without_search
    without_islands = _disabled(copy.copy(model), _NO_ISLANDS)
    return without_islands if moves_equally(model, without_islands) else None


def _disabled(model: mujoco.MjModel, flags: int) -> mujoco.MjModel:
    """Set disable flags of a model, including flags for the features that it lacks; return it."""
    # If both springs and dampers are disabled, MuJoCo skips all other passive forces too, such as
    # fluid forces.
    has_dampers = not model.opt.disableflags & int(_BIT.mjDSBL_DAMPER)
    has_springs = model.jnt_stiffness.any() or model.jnt_stiffnesspoly.any()
    flags |= int(_BIT.mjDSBL_EQUALITY)
    if has_dampers and not has_springs:
        flags |= int(_BIT.mjDSBL_SPRING)
    if not model.dof_frictionloss.any():
        flags |= int(_BIT.mjDSBL_FRICTIONLOSS)
    if not model.nsensor:
        flags |= int(_BIT.mjDSBL_SENSOR)
    model.opt.disableflags |= flags
    return model


def _without_search(
    model: mujoco.MjModel, make_spec: Callable[[], mujoco.MjSpec]
) -> mujoco.MjModel | None:
    """Return the model without islands and with all possible contacts as explicit pairs."""
    if model.npair:
        return None
    _, pairs = colliding_pairs(model)
    if not pairs.size:
        return _disabled(copy.copy(model), _NO_ISLANDS | _NO_SEARCH | _NO_CONTACTS)
    names = [model.geom(geom).name for geom in range(model.ngeom)]
    if not _on_one_floor(model, pairs) or not all(names):
        return None
    spec = make_spec()
    for first, second in pairs.tolist():
        cast("Any", spec).add_pair(geomname1=names[first], geomname2=names[second])
    result = spec.compile()
    if not _same_but_for_pairs(model, result):
        return None
    joined = geoms_of_pairs(result)
    for parameter, values in mixed_parameters(result, joined).items():
        getattr(result, f"pair_{parameter}")[:] = values
    # Exclude all geoms from the search, by their bits and by the bits of their bodies.
    result.geom_contype[:] = result.geom_conaffinity[:] = 0
    result.body_contype[:] = result.body_conaffinity[:] = 0
    return _disabled(result, _NO_ISLANDS | _NO_SEARCH)


def _on_one_floor(model: mujoco.MjModel, pairs: _Ints) -> bool:
    """Return whether each pair joins one fixed geom with the only geom of a body.

    The order of the pairs then follows from the order of the bodies.
    """
    bodies = model.geom_bodyid[pairs]
    fixed = model.body_weldid[bodies] == 0
    floor = np.unique(pairs[fixed])
    moving = bodies[~fixed]
    involved = np.unique(pairs)
    return bool(
        (fixed.sum(axis=1) == 1).all()
        and floor.size == 1
        and np.unique(moving).size == moving.size
        and np.unique(model.geom_priority[involved]).size == 1
        and not model.geom_adhesion[involved].any()
        and not model.geom_surfacevel[involved].any()
    )


def _same_but_for_pairs(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Return whether two models have the same numbers, except names and pairs."""
    own = [name for name in dir(model) if not name.startswith(("pair_", "name", "_"))]
    names = [name for name in own if type(getattr(model, name)) is np.ndarray]
    return all(np.array_equal(getattr(model, name), getattr(other, name)) for name in names)


# Fields that must be equal after every step; they include everything that the next step uses.
_FIELDS: Final = (
    *("time", "qpos", "qvel", "act", "qacc", "qacc_warmstart", "qfrc_constraint", "xpos", "xquat"),
    *("qfrc_passive", "qfrc_spring", "qfrc_damper", "geom_xpos", "cinert", "cvel", "cfrc_ext"),
    *("cfrc_int", "cacc", "actuator_force", "sensordata", "ncon", "nefc"),
)
_OF_CONTACTS: Final = (
    *("geom", "dist", "pos", "frame", "includemargin", "friction", "solref", "solreffriction"),
    *("solimp", "dim", "exclude", "efc_address"),
)
# Number of starts, the first from the model's own pose, and of steps from each.
_STARTS: Final = 6
_STEPS: Final = 8
_SEED: Final = 20170706
# Spread of random poses, as a fraction of a joint's range, or rad and m without one; and standard
# deviation of velocities, rad/s and m/s.
_POSE_NOISE: Final = 0.5
_SPEED: Final = 3.0
# Depth of the trunk below the floor, so that every geom touches it, m.
_SUNK_M: Final = 0.02


def moves_equally(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Return whether two models move equally, to the last bit, from several starts.

    In some starts the trunk is in the air, in others it is thrown, turned over or sunk into the
    floor, so that geoms touch it and joints reach their limits. Where the contact search differs,
    every pair that can collide must have touched.

    Args:
        model: The original model.
        other: The model that is to replace it.
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
            mujoco.mj_forward(model, data)  # With the original model, as in a reset.
        for _ in range(_STEPS):
            action = rng.uniform(-1.0, 1.0, model.nu)
            one.ctrl[:] = two.ctrl[:] = action
            mujoco.mj_step(model, one)
            mujoco.mj_step(other, two)
            mujoco.mj_rnePostConstraint(model, one)
            mujoco.mj_rnePostConstraint(other, two)
            if not (_same(one, two, _FIELDS) and _same(one.contact, two.contact, _OF_CONTACTS)):
                return False
            touched.update(map(tuple, one.contact.geom.tolist()))
    if other.npair == model.npair:
        return True
    _, pairs = colliding_pairs(model)
    return all((a, b) in touched or (b, a) in touched for a, b in pairs.tolist())


def _same(one: Any, two: Any, names: tuple[str, ...]) -> bool:
    """Return whether some fields of two objects have the same bytes."""
    return all(
        np.asarray(getattr(one, name)).tobytes() == np.asarray(getattr(two, name)).tobytes()
        for name in names
    )


def _drawn(
    model: mujoco.MjModel, rng: np.random.Generator, start: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a pose (nq,) and velocities (nv,) to start from."""
    speed = _SPEED * rng.standard_normal(model.nv)
    if start == 0:
        return model.qpos0.copy(), np.zeros(model.nv)
    pose = model.qpos0.copy()
    for joint in range(model.njnt):
        at = int(model.jnt_qposadr[joint])
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            if start % 2:  # Sunk: every geom level with the trunk touches.
                pose[at + 2] = -_SUNK_M * start
            else:
                pose[at + 2] = 0.4
                pose[at + 3 : at + 7] = rng.standard_normal(4)
        elif model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_BALL:
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-1.0, 1.0)
            pose[at] += rng.uniform(-_POSE_NOISE, _POSE_NOISE) * (high - low)
    mujoco.mj_normalizeQuat(model, pose)
    return pose, speed
