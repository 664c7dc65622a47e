"""Loops and couplings: pins keep their places on both bodies, and what was closed stays closed.

MuJoCo states the pin of a loop in the frame of its first body, and takes its place on the second
from the model's own pose. So each pin is two sites while edits are applied; then the own pose is
changed until what was closed in it is closed again, and the pins are written back.
"""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import unique_namer
from shapechanger.morphology.spec.geometry import Array, orientation
from shapechanger.morphology.spec.positions import displace, reference_of, set_reference
from shapechanger.morphology.spec.references import COUPLINGS, MARK, Element

_E: Final = mujoco.mjtEq
_J: Final = mujoco.mjtJoint
_O: Final = mujoco.mjtObj
_ONE_NUMBER: Final = (int(_J.mjJNT_HINGE), int(_J.mjJNT_SLIDE))
_EQUALITY_ROWS: Final = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
_PINS: Final = (_E.mjEQ_CONNECT, _E.mjEQ_WELD)
# Residual of an equality that is closed, m or rad; above the rounding of a compiled model.
_CLOSED: Final = 1e-9
# Points of a closed loop coincide within this, m.
_TOGETHER: Final = 1e-8
# A joint that moves less has not moved, rad or m.
_STILL: Final = 1e-12
_MOST_STEPS: Final = 200
# A longer step, rad or m, can jump to another way to assemble the loop.
_LONGEST_STEP: Final = 0.2
# Singular values below this share of the largest belong to motions that close nothing.
_SINGULAR: Final = 1e-6
_UPRIGHT: Final = np.array([1.0, 0.0, 0.0, 0.0])
_WITHOUT: Final = (
    mujoco.mjtDisableBit.mjDSBL_CONTACT
    | mujoco.mjtDisableBit.mjDSBL_LIMIT
    | mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
)


def has_loops(spec: mujoco.MjSpec) -> bool:
    """Return whether a specification has pins or couplings."""
    return any(equality.type in (*_PINS, *COUPLINGS) for equality in spec.equalities)


def mark_pins(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Replace the places of pins between bodies by sites, which edits carry along.

    Args:
        spec: The specification, with its frames resolved.
        model: The model that it compiles to.
    """
    for i, equality in enumerate(spec.equalities):
        if equality.type not in _PINS or equality.objtype != _O.mjOBJ_BODY:
            continue
        data, welds = model.eq_data[i], equality.type == _E.mjEQ_WELD
        places = (data[3:6], data[:3]) if welds else (data[:3], data[3:6])
        turns = (data[6:10] if welds else _UPRIGHT, _UPRIGHT)
        names = (f"{MARK}{i}", f"{MARK}{i}~")
        bodies = (equality.name1, equality.name2)
        for name, body, place, turn in zip(names, bodies, places, turns, strict=True):
            on = spec.body(body) if body else spec.worldbody
            on.add_site(name=name, pos=place, quat=turn)
        equality.objtype = _O.mjOBJ_SITE
        equality.name1, equality.name2 = names


def open_loops(spec: mujoco.MjSpec, model: mujoco.MjModel) -> set[Element]:
    """Return the pins and couplings that do not hold in the model's own pose.

    Args:
        spec: The specification.
        model: The model that it compiles to.
    """
    residuals = _residuals(spec, _posed(model))
    return {key for key, residual in residuals.items() if residual > _CLOSED}


def close_loops(
    spec: mujoco.MjSpec, model: mujoco.MjModel, ignored: set[Element]
) -> tuple[mujoco.MjData, dict[str, Array]]:
    """Move the joints of the model's own pose until its pins and couplings hold.

    Positions of hinges and slides keep their meaning: their references move.

    Args:
        spec: The specification.
        model: The model that it compiles to.
        ignored: Pins and couplings that did not hold before either.

    Returns:
        The data of the model in its new pose, and the turns of ball joints by their names as
        quaternions (w, x, y, z).

    Raises:
        MorphologyError: If no pose of its joints closes a loop.
    """
    data = _posed(model)
    for i, key in enumerate(_keys(spec)):
        data.eq_active[i] &= key not in ignored
    mujoco.mj_fwdPosition(model, data)
    lengths = np.array(data.ten_length)
    if not _solve(model, data):
        (_, name), gap = max(_residuals(spec, data).items(), key=lambda item: item[1])
        raise MorphologyError(
            f"The edits leave {_loop_of(spec, name)} open by {gap:.3g} m or rad, and no position "
            "of its joints within their limits closes it: change its other links or joints too."
        )
    balls: dict[str, Array] = {}
    changes: dict[Element, float] = {}
    for i in range(model.njnt):
        at = model.jnt_qposadr[i]
        name, by = model.joint(i).name, float(data.qpos[at] - model.qpos0[at])
        if model.jnt_type[i] == _J.mjJNT_BALL:
            turn = data.qpos[at : at + 4].copy()
            if np.abs(turn - _UPRIGHT).max() > _STILL:
                balls[name] = turn
                displace(spec, spec.joint(name), turn)
        elif model.jnt_type[i] != _J.mjJNT_FREE and abs(by) > _STILL:
            joint = spec.joint(name)
            displace(spec, joint, by)
            set_reference(joint, reference_of(joint) + by)
            changes[_O.mjOBJ_JOINT, name] = by
    if changes or balls:
        by_name = zip(range(model.ntendon), data.ten_length - lengths, strict=True)
        changes |= {(_O.mjOBJ_TENDON, model.tendon(i).name): float(by) for i, by in by_name}
        for equality in spec.equalities:
            _shift_coupling(equality, changes)
    return data, balls


def unmark_pins(spec: mujoco.MjSpec, data: mujoco.MjData) -> None:
    """State the pins in the frames of their bodies again, and delete their sites.

    Args:
        spec: The specification.
        data: Its data in the model's own pose.
    """
    free = unique_namer(site.name for site in spec.sites)
    for equality in spec.equalities:
        if equality.type not in _PINS or not equality.name1.startswith(MARK):
            continue
        first, second = spec.site(equality.name1), spec.site(equality.name2)
        a, b, own = data.site(first.name), data.site(second.name), np.array(equality.data)
        together = np.allclose(a.xpos, b.xpos, 0.0, _TOGETHER)
        if equality.type == _E.mjEQ_WELD:
            own[:3] = second.pos
            if own[6:10].any() or not (together and np.allclose(a.xmat, b.xmat, 0.0, _TOGETHER)):
                own[3:6] = first.pos
                own[6:10] = _relative(orientation(spec, second), orientation(spec, first))
        elif together:
            own[:3] = first.pos
        else:  # One that is switched off, and open: only sites can state both places.
            for end, site in enumerate((first, second), 1):
                site.name = free(f"{equality.name or 'pin'}_{end}")
            equality.name1, equality.name2 = first.name, second.name
            continue
        equality.data, equality.objtype = own, _O.mjOBJ_BODY
        equality.name1, equality.name2 = (
            site.parent.name if site.parent.parent is not None else "" for site in (first, second)
        )
    for site in [site for site in spec.sites if site.name.startswith(MARK)]:
        spec.delete(site)


def _posed(model: mujoco.MjModel) -> mujoco.MjData:
    """Return data in the model's own pose, with the rows of its equalities alone."""
    model.opt.disableflags |= int(_WITHOUT)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    return data


def _keys(spec: mujoco.MjSpec) -> list[Element]:
    """Return a key of each equality that edits keep: its kind and the first that it names."""
    return [(COUPLINGS.get(e.type, e.objtype), e.name1) for e in spec.equalities]


def _residuals(spec: mujoco.MjSpec, data: mujoco.MjData) -> dict[Element, float]:
    """Return by how much each active equality is open, m or rad."""
    found: dict[Element, float] = {}
    keys = _keys(spec)
    for row in np.flatnonzero(data.efc_type == _EQUALITY_ROWS).tolist():
        key = keys[int(data.efc_id[row])]
        found[key] = max(found.get(key, 0.0), float(abs(data.efc_pos[row])))
    return found


def _loop_of(spec: mujoco.MjSpec, name: str) -> str:
    """Return what to call the equality whose first name this is."""
    equality = next(e for e in spec.equalities if e.name1 == name)
    names = [equality.name1, equality.name2]
    if name.startswith(MARK):
        names = [spec.site(end).parent.name for end in names]
    ends = " and ".join(repr(end) for end in names if end)
    return f"the {'coupling' if equality.type in COUPLINGS else 'pin'} of {ends}"


def _solve(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Move the joints to the nearest pose in which the equalities hold; return whether there is."""
    movable, low, high = _limits(model)
    at_limit = np.zeros(model.nv, bool)
    for _ in range(_MOST_STEPS):
        rows = data.efc_type == _EQUALITY_ROWS
        residual = data.efc_pos[rows]
        if not residual.size or np.abs(residual).max() <= _CLOSED:
            return True
        jacobian = data.efc_J.reshape(-1, model.nv)[rows]
        step = np.zeros(model.nv)
        turning = movable & ~at_limit
        step[turning] = -np.linalg.pinv(jacobian[:, turning], _SINGULAR) @ residual
        step *= min(1.0, _LONGEST_STEP / max(float(np.abs(step).max(initial=0.0)), _LONGEST_STEP))
        pose = data.qpos.copy()
        mujoco.mj_integratePos(model, pose, step, 1.0)
        clipped = np.clip(pose, low, high)
        # A joint at its limit is left out of the next step, which the others must make.
        at_limit[:] = False
        for i in np.flatnonzero(np.isin(model.jnt_type, _ONE_NUMBER)):
            place = model.jnt_qposadr[i]
            at_limit[model.jnt_dofadr[i]] = clipped[place] != pose[place]
        data.qpos[:] = clipped
        mujoco.mj_fwdPosition(model, data)
    return False


def _limits(model: mujoco.MjModel) -> tuple[Array, Array, Array]:
    """Return the degrees of freedom that may close a loop, and the limits of all coordinates."""
    movable = np.ones(model.nv, bool)
    low, high = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    driven = {
        int(model.actuator_trnid[i, 0])
        for i in range(model.nactuator)
        if model.actuator_trntype[i] in (0, 1)
    }
    for i in range(model.njnt):
        place, dof = model.jnt_qposadr[i], model.jnt_dofadr[i]
        if model.jnt_type[i] == _J.mjJNT_FREE:
            movable[dof : dof + 6] = False
        elif model.jnt_type[i] == _J.mjJNT_BALL:
            # Whatever measures its turn would measure it from the new pose.
            measured = model.jnt_limited[i] or model.jnt_stiffness[i] or i in driven
            movable[dof : dof + 3] = not measured
        elif model.jnt_limited[i]:
            low[place] = min(model.jnt_range[i, 0], model.qpos0[place])
            high[place] = max(model.jnt_range[i, 1], model.qpos0[place])
    return movable, low, high


def _shift_coupling(equality: mujoco.MjsEquality, changes: dict[Element, float]) -> None:
    """Keep the meaning of a coupling, which counts from the references of both elements.

    Args:
        equality: An equality.
        changes: How far references have moved, rad or m.
    """
    kind = COUPLINGS.get(equality.type)
    if kind is None:
        return
    by_follower = changes.get((kind, equality.name1), 0.0)
    by_leader = changes.get((kind, equality.name2), 0.0)
    if by_follower or by_leader:
        data = np.array(equality.data)
        if not equality.name2:
            data[1:5] = 0.0
        # p(x + d) from p(x), by its Taylor series.
        polynomial = np.polynomial.Polynomial(data[:5])
        shifted = np.zeros(5)
        for degree in range(5):
            shifted[degree] = polynomial.deriv(degree)(by_leader) / math.factorial(degree)
        shifted[0] -= by_follower
        data[:5] = shifted
        equality.data = data


def _relative(around: Array, turn: Array) -> Array:
    """Return a turn as seen from another; both are quaternions (w, x, y, z)."""
    back, result = np.empty(4), np.empty(4)
    mujoco.mju_negQuat(back, around)
    mujoco.mju_mulQuat(result, turn, back)
    return result
