"""Running two models side by side, to the last bit."""

from __future__ import annotations

import copy
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Any, Final, cast
from weakref import WeakValueDictionary

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.stepping.watch import ModelWatch
from shapechanger.morphology.effective.contacts import colliding_pairs

__all__ = [
    "Demand",
    "demand_for",
    "find_fast_model",
    "forget_fast_models",
    "known_fast_model",
    "moves_equally",
]

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


_Ints = NDArray[np.int64]

_BIT: Final = mujoco.mjtDisableBit
_NO_ISLANDS: Final = int(_BIT.mjDSBL_ISLAND)
_NO_SEARCH: Final = int(_BIT.mjDSBL_MIDPHASE)
_NO_CONTACTS: Final = int(_BIT.mjDSBL_CONTACT)
# What would let bodies of one tree be solved apart, or tie them to what the rules do not look at.
_UNKNOWN: Final = ("neq", "ntendon", "nflex", "nplugin", "nmocap", "nskin", "nhfield")
# Models that are remembered; those of envs that are in use live on by themselves.
_REMEMBERED: Final = 32
_SMALLEST_MIX: Final = float(cast("Any", mujoco).mjMINVAL)

_twins: OrderedDict[bytes, mujoco.MjModel | None] = OrderedDict()
_demands: WeakValueDictionary[bytes, Demand] = WeakValueDictionary()
_lock = threading.Lock()


def find_fast_model(
    watch: ModelWatch, make_spec: Callable[[], mujoco.MjSpec]
) -> mujoco.MjModel | None:
    """A model that steps the data of the watched model, moves equally, and costs less.

    The answer is remembered, and one twin is shared by all envs of a body: nobody may write to it.

    Args:
        watch: The watch of the compiled model, which is unedited.
        make_spec: Makes what the model was compiled from.

    Returns:
        The twin; None if there is none that is sure to move equally.
    """
    if not watch.sees:
        return None
    name = watch.digest
    with _lock:  # Of several threads with the same body, one looks.
        if name not in _twins:
            _twins[name] = next(
                (
                    candidate
                    for candidate in _candidates(watch.model, make_spec)
                    if moves_equally(watch.model, candidate)
                ),
                None,
            )
            while len(_twins) > _REMEMBERED:
                _twins.popitem(last=False)
        return _twins[name]


def forget_fast_models() -> None:
    """Forget all twins, as for a measurement of what it takes to find one."""
    with _lock:
        _twins.clear()


class Demand:
    """How much a twin would be used.

    Attributes:
        steps: How many steps all envs with one body have taken without.
    """

    def __init__(self) -> None:
        self.steps = 0


def demand_for(watch: ModelWatch) -> Demand:
    """The demand for a twin of the watched model, shared by all envs of its body."""
    name = watch.digest
    with _lock:
        demand = _demands.get(name)
        if demand is None:
            demand = _demands[name] = Demand()
        return demand


def known_fast_model(watch: ModelWatch) -> mujoco.MjModel | None:
    """The twin of the watched model, as it was when the watch began, if it has been found."""
    name = watch.digest
    with _lock:
        if name in _twins:
            _twins.move_to_end(name)
        return _twins.get(name)


def _candidates(
    model: mujoco.MjModel, make_spec: Callable[[], mujoco.MjSpec]
) -> Iterator[mujoco.MjModel]:
    """What the rules allow, the cheapest first."""
    if _is_one_tree(model):
        without_search = _without_search(model, make_spec)
        if without_search is not None:
            yield without_search
        yield _in_one_piece(model)


def _is_one_tree(model: mujoco.MjModel) -> bool:
    """Whether all constraints are about one tree, and nothing unknown is in the model."""
    return (
        model.ntree == 1
        and not model.opt.enableflags
        and not any(getattr(model, size) for size in _UNKNOWN)
        and mujoco.get_mjcb_contactfilter() is None
    )


def _in_one_piece(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model without the search for islands."""
    result = copy.copy(model)
    result.opt.disableflags |= _NO_ISLANDS | _idle(model)
    return result


def _idle(model: mujoco.MjModel) -> int:
    """The flags of what the model has none of; it has nothing unknown, such as tendons."""
    # Without springs and dampers MuJoCo leaves out all other passive forces too.
    has_dampers = not model.opt.disableflags & int(_BIT.mjDSBL_DAMPER)
    has_springs = model.jnt_stiffness.any() or model.jnt_stiffnesspoly.any()
    idle = int(_BIT.mjDSBL_EQUALITY)
    if has_dampers and not has_springs:
        idle |= int(_BIT.mjDSBL_SPRING)
    if not model.dof_frictionloss.any():
        idle |= int(_BIT.mjDSBL_FRICTIONLOSS)
    if not model.nsensor:
        idle |= int(_BIT.mjDSBL_SENSOR)
    return idle


def _without_search(
    model: mujoco.MjModel, make_spec: Callable[[], mujoco.MjSpec]
) -> mujoco.MjModel | None:
    """The model without islands and with all its contacts as explicit pairs."""
    if model.npair:
        return None
    _, pairs = colliding_pairs(model)
    if not pairs.size:
        result = copy.copy(model)
        result.opt.disableflags |= _NO_ISLANDS | _NO_SEARCH | _NO_CONTACTS | _idle(model)
        return result
    names = [model.geom(geom).name for geom in range(model.ngeom)]
    if not _on_one_floor(model, pairs) or not all(names):
        return None
    spec = make_spec()
    for first, second in pairs.tolist():
        cast("Any", spec).add_pair(geomname1=names[first], geomname2=names[second])
    result = spec.compile()
    if not _same_but_for_pairs(model, result):
        return None
    _mix(result)
    # No geom is left for the search, by itself or by its body.
    for bits in (
        result.geom_contype,
        result.geom_conaffinity,
        result.body_contype,
        result.body_conaffinity,
    ):
        bits[:] = 0
    result.opt.disableflags |= _NO_ISLANDS | _NO_SEARCH | _idle(model)
    return result


def _on_one_floor(model: mujoco.MjModel, pairs: _Ints) -> bool:
    """Whether each pair is the one fixed geom with the one geom of a body, mixed alike.

    Then the order of the pairs, which is that of their bodies, leaves nothing open.
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


def _mix(model: mujoco.MjModel) -> None:
    """Give each pair the numbers that the search would have mixed from its geoms.

    Source: MuJoCo 4.0.0, `mujoco/doc/modeling.rst`, "Contact parameters"; margins and gaps are
    summed, as measured.
    """
    one, other = model.pair_geom1, model.pair_geom2
    model.pair_margin[:] = model.geom_margin[one] + model.geom_margin[other]
    model.pair_gap[:] = model.geom_gap[one] + model.geom_gap[other]
    model.pair_dim[:] = np.maximum(model.geom_condim[one], model.geom_condim[other])
    friction = np.maximum(model.geom_friction[one], model.geom_friction[other])
    model.pair_friction[:] = friction[:, [0, 0, 1, 2, 2]]
    model.pair_solreffriction[:] = 0.0
    for pair, (first, second) in enumerate(zip(one.tolist(), other.tolist(), strict=True)):
        part = _part(*model.geom_solmix[[first, second]].tolist())
        both = model.geom_solref[[first, second]]
        model.pair_solref[pair] = (
            part * both[0] + (1.0 - part) * both[1]
            if (both[:, 0] > 0.0).all()
            else both.min(axis=0)  # Given directly, not as time and damping.
        )
        model.pair_solimp[pair] = (
            part * model.geom_solimp[first] + (1.0 - part) * model.geom_solimp[second]
        )


def _part(one: float, other: float) -> float:
    """The part of the first geom in a mix."""
    if one >= _SMALLEST_MIX and other >= _SMALLEST_MIX:
        return one / (one + other)
    if one < _SMALLEST_MIX and other < _SMALLEST_MIX:
        return 0.5
    return 0.0 if one < _SMALLEST_MIX else 1.0


def _same_but_for_pairs(model: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether two models hold the same numbers, names and pairs apart."""
    for name in dir(model):
        mine: Any = getattr(model, name)
        if type(mine) is not np.ndarray or name.startswith(("pair_", "name", "_")):
            continue
        its: Any = getattr(other, name)
        if its.dtype != mine.dtype or not np.array_equal(its, mine):
            return False
    return True
