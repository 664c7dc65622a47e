"""Data that refer to positions or order: keyframes, pins of loops, paths of tendons.

While edits are applied, keyframes are removed, and each pin (a `connect` or `weld`) is moved to
two sites. MuJoCo states a pin in the frame of its first body, and derives its place on the second
body from the model's own pose. After the edits, that pose is changed until every loop that was
closed in it is closed again. Then pins and keyframes are written back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec import compiled, unique_namer
from shapechanger.morphology.spec.geometry import (
    OPPOSITE,
    UPRIGHT,
    Array,
    as_written,
    displace,
    orientation,
    product,
    reference_of,
)
from shapechanger.morphology.spec.references import COUPLINGS, MARK, OF_JOINTS, PINS, Element

_E: Final = mujoco.mjtEq
_J: Final = mujoco.mjtJoint
_O: Final = mujoco.mjtObj
_W: Final = mujoco.mjtWrap
_D: Final = mujoco.mjtDisableBit
_MOST_STEPS: Final = 200
# Fields of a keyframe, and of the data that they fill.
_FIELDS: Final = {
    **{field: field for field in ("qpos", "qvel", "act", "ctrl")},
    **{"mpos": "mocap_pos", "mquat": "mocap_quat"},
}
_WITHIN: Final = 1e-6  # A tendon may exceed its limit by this much, m or rad.
_TOGETHER: Final = 1e-8  # Points of a closed loop coincide within this, m.
_STILL: Final = 1e-12  # A smaller motion of a joint is rounding, rad or m.
CLOSED: Final = 1e-9
"""Largest residual of a closed equality, m or rad; above the rounding of a compiled model."""
SINGULAR: Final = 1e-6
"""Singular values below this share of the largest belong to motions that do not close a loop."""

# Equalities that a pose can close, by Gauss-Newton steps on MuJoCo's own Jacobian.
_SOLVED: Final = [
    int(kind) for kind in (_E.mjEQ_CONNECT, _E.mjEQ_WELD, _E.mjEQ_JOINT, _E.mjEQ_TENDON)
]
_LONGEST_STEP: Final = 0.2  # A longer step, rad or m, can jump to another way to assemble the loop.
_UNLIMITED: Final = np.array([[-np.inf], [np.inf]])


@contextmanager
def carried(spec: mujoco.MjSpec) -> Generator[Keyframes]:
    """Take keyframes and pins out of the way of edits, yield the keyframes, and write all back."""

    def loops() -> bool:
        return any(equality.type in (*PINS, *COUPLINGS) for equality in spec.equalities)

    if not (spec.keys or spec.tendons or loops()):
        yield Keyframes(spec, None)
        return
    for i, tendon in enumerate(spec.tendons):
        tendon.name = tendon.name or f"{MARK}tendon{i}"
    model = compiled(spec)
    keyframes = Keyframes(spec, model)
    tendons, torn = _tendons(model), set[Element]()
    if loops():
        _mark_pins(spec, model)
        marked = compiled(spec)
        residuals = _residuals(spec, marked, _posed(marked))
        torn = {key for key, residual in residuals.items() if residual > CLOSED}
    yield keyframes
    if loops():
        _unmark_pins(spec, _close_loops(spec, compiled(spec), torn, keyframes))
    if spec.tendons:
        _follow_tendons(spec, tendons)
    keyframes.put_back(spec)


class Keyframes:
    """The keyframes of a specification, removed from it while edits are applied."""

    def __init__(self, spec: mujoco.MjSpec, model: Any) -> None:
        # For each keyframe: name and time, the given fields, and numbers by field and element name.
        self._values: list[tuple[dict[str, Any], list[str], dict[tuple[str, str], Array]]] = []
        for i, key in enumerate(list(spec.keys)):
            data = mujoco.MjData(model)
            mujoco.mj_resetDataKeyframe(model, data, i)
            given = [field for field in _FIELDS if len(getattr(key, field))]
            numbers = _numbers(model, data).items()
            values = {at: view.copy() for at, view in numbers if at[0] in given}
            self._values.append(({"name": key.name, "time": key.time}, given, values))
            spec.delete(key)

    def copy(self, originals: Mapping[str, str]) -> None:
        """Give copied joints, actuators and bodies the values of their originals."""
        for _, given, values in self._values:
            pairs = [((f, new), (f, old)) for new, old in originals.items() for f in given]
            values |= {new: values[old] for new, old in pairs if old in values}

    def change(self, joint: str, changed: Callable[[Array], Array]) -> None:
        """Change the position of a joint in every keyframe that gives positions.

        `changed` returns the new position (1, 4 or 7 numbers) from the old one.
        """
        for _, _, values in self._values:
            if ("qpos", joint) in values:
                values["qpos", joint] = changed(values["qpos", joint])

    def put_back(self, spec: mujoco.MjSpec) -> None:
        """Add the keyframes to the edited specification; new elements get the model's own pose."""
        model: Any = compiled(spec) if self._values else None
        for about, given, values in self._values:
            data, key = mujoco.MjData(model), spec.add_key(**about)
            for at, view in _numbers(model, data).items():
                if at in values and values[at].size == view.size:
                    view[:] = values[at]
            for field in given:
                setattr(key, field, getattr(data, _FIELDS[field]).ravel())


def _numbers(model: mujoco.MjModel, data: mujoco.MjData) -> dict[tuple[str, str], Array]:
    # Views of `data`, keyed by field of a keyframe and name of the element.
    found: dict[tuple[str, str], Array] = {}
    for joint in (data.joint(i) for i in range(model.njnt)):
        found |= {("qpos", joint.name): joint.qpos, ("qvel", joint.name): joint.qvel}
    for i, (at, n) in enumerate(zip(model.actuator_actadr, model.actuator_actnum, strict=True)):
        name = model.actuator(i).name
        found |= {("act", name): data.act[at : at + n], ("ctrl", name): data.actuator(i).ctrl}
    for body in np.flatnonzero(model.body_mocapid >= 0).tolist():
        name, i = model.body(body).name, model.body_mocapid[body]
        found |= {("mpos", name): data.mocap_pos[i], ("mquat", name): data.mocap_quat[i]}
    return found


class _Tendon(NamedTuple):
    length: float  # In the model's own pose, m; of a fixed tendon, the weighted sum of its joints.
    fits: bool  # Whether the length is within the tendon's limits; true without limits.
    inside: list[bool]  # For each wrapped geom with a side site, whether the site is inside it.


def _tendons(model: mujoco.MjModel) -> dict[str, _Tendon]:
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    found: dict[str, _Tendon] = {}
    for i in range(model.ntendon):
        inside: list[bool] = []
        path = slice(model.tendon_adr[i], model.tendon_adr[i] + model.tendon_num[i])
        wraps = (model.wrap_type[path], model.wrap_objid[path], model.wrap_prm[path].astype(int))
        for kind, geom, side in zip(*wraps, strict=True):
            if kind in (int(_W.mjWRAP_SPHERE), int(_W.mjWRAP_CYLINDER)) and side >= 0:
                place = data.site_xpos[side] - data.geom_xpos[geom]
                place = data.geom_xmat[geom].reshape(3, 3).T @ place
                # For a tendon, a cylinder is infinitely long.
                reach = place[:2] if kind == _W.mjWRAP_CYLINDER else place
                inside.append(bool(np.linalg.norm(reach) < model.geom_size[geom, 0]))
        length = float(data.ten_length[i])
        low, high = model.tendon_range[i]
        fits = not model.tendon_limited[i] or low - _WITHIN <= length <= high + _WITHIN
        found[model.tendon(i).name] = _Tendon(length, bool(fits), inside)
    return found


def _follow_tendons(spec: mujoco.MjSpec, tendons: dict[str, _Tendon]) -> None:
    """Refuse tendons that change sides or exceed a limit, and fit muscles to their new lengths."""
    new = _tendons(compiled(spec))
    for name, now in new.items():
        old = tendons.get(name, now)
        if old.inside != now.inside and len(old.inside) == len(now.inside):
            raise MorphologyError(
                f"The tendon {name!r} would pass a geom on its other side, because its side "
                "site gets into the geom or out of it: change the geom less."
            )
        if old.fits and not now.fits:
            raise MorphologyError(
                f"The tendon {name!r} would start {now.length:.3g} long, outside of its "
                "limits: write other limits into the model first."
            )
    for actuator in spec.actuators:
        old = tendons.get(actuator.target)
        tendon = actuator.trntype == mujoco.mjtTrn.mjTRN_TENDON
        muscle = actuator.gaintype == mujoco.mjtGain.mjGAIN_MUSCLE
        if tendon and muscle and old and np.any(actuator.lengthrange):
            # The method of musculoskeletal models that are fitted to a person: S. Delp and others,
            # OpenSim, IEEE Transactions on Biomedical Engineering 54(11), 2007.
            actuator.lengthrange *= new[actuator.target].length / old.length
    for tendon in spec.tendons:
        if tendon.name.startswith(MARK):
            tendon.name = ""


def _mark_pins(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Replace the places of pins between bodies by sites, which edits carry along."""
    for i, equality in enumerate(spec.equalities):
        if equality.type not in PINS or equality.objtype != _O.mjOBJ_BODY:
            continue
        data, welds = model.eq_data[i], equality.type == _E.mjEQ_WELD
        places = (data[3:6], data[:3]) if welds else (data[:3], data[3:6])
        turns = (data[6:10] if welds else UPRIGHT, UPRIGHT)
        names = (f"{MARK}{i}", f"{MARK}{i}~")
        bodies = (equality.name1, equality.name2)
        for name, body, place, turn in zip(names, bodies, places, turns, strict=True):
            on = spec.body(body) if body else spec.worldbody
            on.add_site(name=name, pos=place, quat=turn)
        equality.objtype = _O.mjOBJ_SITE
        equality.name1, equality.name2 = names


def _close_loops(
    spec: mujoco.MjSpec, model: mujoco.MjModel, torn: set[Element], keyframes: Keyframes
) -> mujoco.MjData:
    """Move the joints of the model's own pose until no pin or coupling is open, except `torn` ones.

    References of hinges and slides, and balls in the keyframes, are moved along, so that positions
    keep their meaning. Return the data of the model in its new pose.
    """
    data = _posed(model)
    for i, key in enumerate(_keys(spec)):
        data.eq_active[i] &= key not in torn
    mujoco.mj_fwdPosition(model, data)
    lengths = np.array(data.ten_length)
    kinds = model.jnt_type
    # Balls with a limit, spring or motor stay: their turn is measured from the model's own pose.
    driven = model.actuator_trnid[np.isin(model.actuator_trntype, [int(t) for t in OF_JOINTS]), 0]
    measured = (model.jnt_limited != 0) | (model.jnt_stiffness != 0.0)
    measured |= np.isin(np.arange(model.njnt), driven)
    still = (kinds == int(_J.mjJNT_FREE)) | ((kinds == int(_J.mjJNT_BALL)) & measured)
    if close(model, data, ~still[model.dof_jntid], _MOST_STEPS) > CLOSED:
        (_, name), gap = max(_residuals(spec, model, data).items(), key=lambda item: item[1])
        ends = next([e.name1, e.name2] for e in spec.equalities if e.name1 == name)
        if name.startswith(MARK):
            ends = [spec.site(end).parent.name for end in ends]
        raise MorphologyError(
            f"The edits leave the pin or coupling of {' and '.join(map(repr, filter(None, ends)))} "
            f"open by {gap:.3g} m or rad, and no position of its joints within their limits closes "
            "it: change its other links or joints too."
        )
    moved = False
    changes: dict[Element, float] = {}
    for i in range(model.njnt):
        joint, at = spec.joint(model.joint(i).name), model.jnt_qposadr[i]
        by = float(data.qpos[at] - model.qpos0[at])
        if joint.type == _J.mjJNT_BALL:
            turn = data.qpos[at : at + 4].copy()
            if np.abs(turn - UPRIGHT).max() > _STILL:
                moved = True
                displace(joint, turn)
                keyframes.change(joint.name, lambda pose, turn=turn: product(OPPOSITE * turn, pose))
        elif joint.type != _J.mjJNT_FREE and abs(by) > _STILL:
            moved = True
            displace(joint, by)
            joint.ref = as_written(joint, reference_of(joint) + by)
            changes[_O.mjOBJ_JOINT, joint.name] = by
    if moved:
        longer = (data.ten_length - lengths).tolist()
        changes |= {(_O.mjOBJ_TENDON, model.tendon(i).name): by for i, by in enumerate(longer)}
        for equality in spec.equalities:
            _shift_coupling(equality, changes)
    return data


def _unmark_pins(spec: mujoco.MjSpec, data: mujoco.MjData) -> None:
    free = unique_namer(site.name for site in spec.sites)
    for equality in spec.equalities:
        if equality.type not in PINS or not equality.name1.startswith(MARK):
            continue
        first, second = spec.site(equality.name1), spec.site(equality.name2)
        a, b, own = data.site(first.name), data.site(second.name), np.array(equality.data)
        together = np.allclose(a.xpos, b.xpos, 0.0, _TOGETHER)
        if equality.type == _E.mjEQ_WELD:
            own[:3] = second.pos
            if own[6:10].any() or not (together and np.allclose(a.xmat, b.xmat, 0.0, _TOGETHER)):
                own[3:6] = first.pos
                own[6:10] = product(orientation(first), OPPOSITE * orientation(second))
        elif together:
            own[:3] = first.pos
        else:  # The pin is switched off and open: only sites can state both places.
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
    """Return data in the model's own pose, with no constraints but equalities."""
    model.opt.disableflags |= _D.mjDSBL_CONTACT | _D.mjDSBL_LIMIT | _D.mjDSBL_FRICTIONLOSS
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    return data


def _keys(spec: mujoco.MjSpec) -> list[Element]:
    # Edits change neither the kind of an equality nor the first element that it names.
    return [(COUPLINGS.get(e.type, e.objtype), e.name1) for e in spec.equalities]


def _residuals(
    spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData
) -> dict[Element, float]:
    """Return by how much each active equality is open, m or rad."""
    found, keys = dict[Element, float](), _keys(spec)
    rows, gaps, _ = equality_rows(model, data)
    for row, gap in zip(rows, gaps, strict=True):
        key = keys[int(row)]
        found[key] = max(found.get(key, 0.0), float(abs(gap)))
    return found


def _shift_coupling(equality: mujoco.MjsEquality, changes: dict[Element, float]) -> None:
    """Keep the meaning of a coupling after references have moved by `changes`, rad or m."""
    kind = COUPLINGS.get(equality.type, _O.mjOBJ_UNKNOWN)
    by_follower, by_leader = (changes.get((kind, n), 0.0) for n in (equality.name1, equality.name2))
    if by_follower or by_leader:
        data = np.array(equality.data)
        if not equality.name2:
            data[1:5] = 0.0
        # p(x + d) from p(x), with its Taylor series.
        polynomial = np.polynomial.Polynomial(data[:5])
        data[:5] = [polynomial.deriv(n)(by_leader) / math.factorial(n) for n in range(5)]
        data[0] -= by_follower
        equality.data = data


def equality_rows(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[NDArray[np.int32], Array, Array]:
    """Return the equality, the violation and the Jacobian (n, nv) of each row of equalities.

    `data` must be up to date with `mj_fwdPosition`.
    """
    ids = data.efc_id[: int(data.ne)]
    rows = np.flatnonzero(np.isin(model.eq_type[ids], _SOLVED))
    dense = np.zeros((int(data.nefc), model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(
            dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    else:
        dense[:] = data.efc_J.reshape(dense.shape)
    return ids[rows], data.efc_pos[rows], dense[rows]


def close(
    model: mujoco.MjModel, data: mujoco.MjData, movable: NDArray[np.bool_], most_steps: int
) -> float:
    """Move the pose in `data` towards the nearest one in which the equalities hold.

    Only the `movable` degrees of freedom (nv,) move, in at most `most_steps` steps. Hinges and
    slides stay inside their limits; those outside get no farther away. The largest remaining
    violation is returned, m or rad.
    """
    scalar, at_limit = np.flatnonzero(model.jnt_type > int(_J.mjJNT_BALL)), np.zeros(model.nv, bool)
    places, dofs = model.jnt_qposadr[scalar], model.jnt_dofadr[scalar]
    low, high = np.where(model.jnt_limited[scalar], model.jnt_range[scalar].T, _UNLIMITED)
    low, high = np.minimum(low, data.qpos[places]), np.maximum(high, data.qpos[places])
    for _ in range(most_steps):
        _, gaps, jacobian = equality_rows(model, data)
        if largest(gaps) <= CLOSED:
            break
        step, moving = np.zeros(model.nv), movable & ~at_limit
        step[moving] = -np.linalg.pinv(jacobian[:, moving], SINGULAR) @ gaps
        step *= min(1.0, _LONGEST_STEP / max(largest(step), _LONGEST_STEP))
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        clipped = np.clip(data.qpos[places], low, high)
        # A joint at its limit is held in the next step, and only the others move.
        at_limit[dofs] = clipped != data.qpos[places]
        data.qpos[places] = clipped
        mujoco.mj_fwdPosition(model, data)
    return largest(equality_rows(model, data)[1])


def largest(numbers: Array) -> float:
    """Return the largest absolute value; 0 for an empty array."""
    return float(np.abs(numbers).max(initial=0.0))
