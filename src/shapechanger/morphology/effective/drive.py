"""The part of an effective model that drives and binds it: actuators, tendons, equalities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.contacts import safe_solref
from shapechanger.morphology.effective.elements import Rows, Section, Value, is_any, word

if TYPE_CHECKING:
    from shapechanger.morphology.effective.elements import Names

_GAIN: Final = mujoco.mjtGain
_BIAS: Final = mujoco.mjtBias
_DYN: Final = mujoco.mjtDyn
_TRN: Final = mujoco.mjtTrn

# How many of the parameters the built-in types read; the others read all.
_GAIN_COUNT: Final = {_GAIN.mjGAIN_FIXED: 1, _GAIN.mjGAIN_AFFINE: 3}
_BIAS_COUNT: Final = {_BIAS.mjBIAS_NONE: 0, _BIAS.mjBIAS_AFFINE: 3}
_DYN_COUNT: Final = {
    _DYN.mjDYN_NONE: 0,
    _DYN.mjDYN_INTEGRATOR: 0,
    _DYN.mjDYN_FILTER: 1,
    _DYN.mjDYN_FILTEREXACT: 1,
}
_EQUALITY_COUNT: Final = {
    mujoco.mjtEq.mjEQ_CONNECT: 6,
    mujoco.mjtEq.mjEQ_JOINT: 5,
    mujoco.mjtEq.mjEQ_TENDON: 5,
}
# Types of gain for which the input signature chooses what the controls are.
_GAINS_WITH_INPUTS: Final = (_GAIN.mjGAIN_SO3, _GAIN.mjGAIN_PID, _GAIN.mjGAIN_DCMOTOR)


def actuators(model: mujoco.MjModel, names: Names) -> Section:
    """Return transmissions, gains, biases and dynamics of the actuators.

    Args:
        model: The model.
        names: Names of its elements.
    """
    rows = Rows(names.actuators)
    transmissions = [_TRN(kind) for kind in model.actuator_trntype.tolist()]
    gains = [_GAIN(kind) for kind in model.actuator_gaintype.tolist()]
    biases = [_BIAS(kind) for kind in model.actuator_biastype.tolist()]
    dynamics = [_DYN(kind) for kind in model.actuator_dyntype.tolist()]
    rows.words("transmission", map(word, transmissions))
    rows.words("target", names.targets)
    rows.words("second site", _second_sites(model, names, transmissions))
    crank = model.actuator_trntype == _TRN.mjTRN_SLIDERCRANK
    rows.numbers("crank length", model.actuator_cranklength, crank)
    rows.words("gear", _gears(model, transmissions))
    rows.words("gain type", map(word, gains))
    rows.words("gain", _read(model.actuator_gainprm, [_GAIN_COUNT.get(g, 10) for g in gains]))
    rows.words("bias type", map(word, biases))
    rows.words("bias", _read(model.actuator_biasprm, [_BIAS_COUNT.get(b, 10) for b in biases]))
    rows.words("dynamics type", map(word, dynamics))
    rows.words("dynamics", _read(model.actuator_dynprm, [_DYN_COUNT.get(d, 10) for d in dynamics]))
    signed = is_any(model.actuator_gaintype, *_GAINS_WITH_INPUTS)
    rows.numbers("inputs", model.actuator_ctrlspec, signed)
    rows.words("control range", _control_ranges(model))
    rows.numbers("force range", model.actuator_forcerange, model.actuator_forcelimited)
    rows.numbers("activation range", model.actuator_actrange, model.actuator_actlimited)
    stateful = model.actuator_actnum > 0
    rows.numbers("early activation", model.actuator_actearly, stateful)
    muscle = is_any(model.actuator_gaintype, _GAIN.mjGAIN_MUSCLE)
    rows.words("length range", _per_output(model, model.actuator_lengthrange, muscle))
    delayed = model.actuator_historyadr >= 0
    rows.numbers("delay", model.actuator_delay, delayed)
    rows.numbers("delay buffer", model.actuator_history, delayed)
    # What an actuator adds to its joint or tendon counts only where that knows of it.
    users = np.concatenate([model.jnt_actuatorid, model.tendon_actuatorid])
    added = np.isin(np.arange(model.nactuator), users)
    rows.numbers("damping", model.actuator_damping, added)
    rows.numbers("damping polynomial", model.actuator_dampingpoly, added)
    rows.numbers("armature", model.actuator_armature, added)
    disabled = (model.opt.disableactuator >> model.actuator_group.clip(0, 30)) & 1 > 0
    rows.numbers("switched off", disabled, disabled)
    return rows.section(in_order=True)


def tendons(model: mujoco.MjModel, names: Names) -> Section:
    """Return the path of each tendon, its limits and its resistance.

    Args:
        model: The model.
        names: Names of its elements.
    """
    rows = Rows(names.tendons)
    rows.words("path", _paths(model, names))
    limited = model.tendon_limited
    rows.numbers("tendon range", model.tendon_range, limited)
    rows.numbers("limit margin", model.tendon_margin, limited)
    rows.numbers("limit solref", safe_solref(model, model.tendon_solref_lim), limited)
    rows.numbers("limit solimp", model.tendon_solimp_lim, limited)
    springy = (model.tendon_stiffness != 0.0) | model.tendon_stiffnesspoly.any(axis=1)
    rows.numbers("stiffness", model.tendon_stiffness)
    rows.numbers("stiffness polynomial", model.tendon_stiffnesspoly, springy)
    rows.numbers("spring yield", model.tendon_springyield, springy & (model.tendon_plasticadr >= 0))
    rows.numbers("spring length", model.tendon_lengthspring, springy)
    rows.numbers("damping", model.tendon_damping)
    rows.numbers("damping polynomial", model.tendon_dampingpoly)
    rows.numbers("armature", model.tendon_armature)
    rows.numbers("friction loss", model.tendon_frictionloss)
    rubbing = model.tendon_frictionloss > 0.0
    rows.numbers("friction solref", safe_solref(model, model.tendon_solref_fri), rubbing)
    rows.numbers("friction solimp", model.tendon_solimp_fri, rubbing)
    rows.numbers("actuator force range", model.tendon_actfrcrange, model.tendon_actfrclimited)
    return rows.section()


def equalities(model: mujoco.MjModel, names: Names) -> Section:
    """Return the equality constraints.

    Args:
        model: The model.
        names: Names of its elements.
    """
    rows = Rows(names.equalities)
    kinds = [mujoco.mjtEq(kind) for kind in model.eq_type.tolist()]
    rows.words("type", map(word, kinds))
    by_type = {
        mujoco.mjtEq.mjEQ_JOINT: names.joints,
        mujoco.mjtEq.mjEQ_TENDON: names.tendons,
        mujoco.mjtEq.mjEQ_FLEX: names.flexes,
        mujoco.mjtEq.mjEQ_FLEXSTRAIN: names.flexes,
    }
    # Only points, which may be of bodies or of sites, say what they are fixed to.
    on_sites = is_any(model.eq_objtype, mujoco.mjtObj.mjOBJ_SITE).tolist()
    between: list[tuple[Value, ...]] = []
    for kind, sites, one, two in zip(
        kinds, on_sites, model.eq_obj1id.tolist(), model.eq_obj2id.tolist(), strict=True
    ):
        bound = by_type.get(kind, names.sites if sites else names.bodies)
        between.append(tuple(bound[int(i)] for i in (one, two) if i >= 0))
    rows.words("between", between)
    rows.numbers("active", model.eq_active0)
    rows.numbers("solref", safe_solref(model, model.eq_solref))
    rows.numbers("solimp", model.eq_solimp)
    rows.words("data", _read(model.eq_data, [_EQUALITY_COUNT.get(kind, 11) for kind in kinds]))
    return rows.section()


def _read(values: NDArray[np.float64], counts: list[int]) -> list[tuple[Value, ...]]:
    """The first numbers of each row."""
    rows = (values + 0.0).tolist()
    return [tuple(row[:count]) for row, count in zip(rows, counts, strict=True)]


def _per_output(
    model: mujoco.MjModel, values: NDArray[np.float64], where: NDArray[np.bool_]
) -> list[tuple[Value, ...]]:
    """For each actuator the rows of its force outputs; empty where `where` does not hold."""
    starts, counts = model.actuator_outadr.tolist(), model.actuator_outnum.tolist()
    return [
        tuple((values[start : start + count] + 0.0).ravel().tolist()) if wanted else ()
        for start, count, wanted in zip(starts, counts, where.tolist(), strict=True)
    ]


def _gears(model: mujoco.MjModel, transmissions: list[mujoco.mjtTrn]) -> list[tuple[Value, ...]]:
    """For each actuator the gear numbers that its transmission reads.

    A hinge, a slide, a tendon and a crank have one direction; a ball has three, a free body and a
    site six.
    """
    everywhere = np.ones(model.nactuator, np.bool_)
    gears = _per_output(model, model.actuator_gear, everywhere)
    single = {_TRN.mjTRN_TENDON, _TRN.mjTRN_SLIDERCRANK, _TRN.mjTRN_BODY}
    on_joint = {_TRN.mjTRN_JOINT, _TRN.mjTRN_JOINTINPARENT}
    found: list[tuple[Value, ...]] = []
    for gear, kind, target in zip(
        gears, transmissions, model.actuator_trnid[:, 0].tolist(), strict=True
    ):
        count = 1 if kind in single else len(gear)
        if kind in on_joint:
            count = {mujoco.mjtJoint.mjJNT_FREE: 6, mujoco.mjtJoint.mjJNT_BALL: 3}.get(
                mujoco.mjtJoint(model.jnt_type[target]), 1
            )
        found.append(gear[:count])
    return found


def _second_sites(
    model: mujoco.MjModel, names: Names, transmissions: list[mujoco.mjtTrn]
) -> list[str]:
    """For each actuator its reference or slider site; empty where it has none."""
    with_sites = {_TRN.mjTRN_SITE, _TRN.mjTRN_SLIDERCRANK, _TRN.mjTRN_SO3}
    return [
        names.sites[second] if kind in with_sites and second >= 0 else ""
        for kind, second in zip(transmissions, model.actuator_trnid[:, 1].tolist(), strict=True)
    ]


def _control_ranges(model: mujoco.MjModel) -> list[tuple[Value, ...]]:
    """For each actuator the ranges of its controls; "free" for one without a limit."""
    limited, ranges = model.actuator_ctrllimited.tolist(), (model.actuator_ctrlrange + 0.0).tolist()
    found: list[tuple[Value, ...]] = []
    for start, count in zip(
        model.actuator_ctrladr.tolist(), model.actuator_ctrlnum.tolist(), strict=True
    ):
        values: list[Value] = []
        for i in range(start, start + count):
            values += ranges[i] if limited[i] else ["free"]
        found.append(() if set(values) == {"free"} else tuple(values))
    return found


def _paths(model: mujoco.MjModel, names: Names) -> list[tuple[Value, ...]]:
    """For each tendon what it passes: kind, name, and coefficient, divisor or side site."""
    wrap = mujoco.mjtWrap
    passed = {
        wrap.mjWRAP_JOINT: names.joints,
        wrap.mjWRAP_SITE: names.sites,
        wrap.mjWRAP_SPHERE: names.geoms,
        wrap.mjWRAP_CYLINDER: names.geoms,
    }
    stops: list[tuple[Value, ...]] = []
    for number, what, parameter in zip(
        model.wrap_type.tolist(),
        model.wrap_objid.tolist(),
        (model.wrap_prm + 0.0).tolist(),
        strict=True,
    ):
        kind = wrap(number)
        name = passed[kind][int(what)] if kind in passed else ""
        last: Value = parameter
        if kind in (wrap.mjWRAP_SPHERE, wrap.mjWRAP_CYLINDER):
            last = names.sites[int(parameter)] if parameter >= 0.0 else ""
        stops.append((word(kind), name, last))
    return [
        tuple(value for stop in stops[start : start + count] for value in stop)
        for start, count in zip(model.tendon_adr.tolist(), model.tendon_num.tolist(), strict=True)
    ]
