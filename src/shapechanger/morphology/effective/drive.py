"""The actuators, tendons and equality constraints of an effective model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.contacts import safe_solref
from shapechanger.morphology.effective.elements import Rows, Section, Value, is_any, words

if TYPE_CHECKING:
    from shapechanger.morphology.effective.elements import Names

# How many parameters the built-in types read; the others read all.
_GAIN_COUNT: Final = {"fixed": 1, "affine": 3}
_BIAS_COUNT: Final = {"none": 0, "affine": 3}
_DYN_COUNT: Final = {"none": 0, "integrator": 0, "filter": 1, "filterexact": 1}
_EQUALITY_COUNT: Final = {"connect": 6, "joint": 5, "tendon": 5}
_MOST_EQUALITY_COUNT: Final = 11  # A weld's.
# How many gear numbers a transmission reads; one to a joint reads as many as the joint has degrees
# of freedom, any other all.
_GEAR_COUNT: Final = {"tendon": 1, "slidercrank": 1, "body": 1}
_JOINT_GEAR_COUNT: Final = {"free": 6, "ball": 3, "slide": 1, "hinge": 1}
_TO_JOINT: Final = ("joint", "jointinparent")
_WITH_SITES: Final = ("site", "slidercrank", "so3")
# Types of gain for which the input signature chooses what the controls are.
_GAINS_WITH_INPUTS: Final = (
    mujoco.mjtGain.mjGAIN_SO3,
    mujoco.mjtGain.mjGAIN_PID,
    mujoco.mjtGain.mjGAIN_DCMOTOR,
)


def actuators(model: mujoco.MjModel, names: Names) -> Section:
    """Return transmissions, gains, biases and dynamics of the actuators.

    Args:
        model: The model.
        names: Names of its elements.
    """
    rows = Rows(names.actuators)
    transmissions = words(mujoco.mjtTrn, model.actuator_trntype)
    gains = words(mujoco.mjtGain, model.actuator_gaintype)
    biases = words(mujoco.mjtBias, model.actuator_biastype)
    dynamics = words(mujoco.mjtDyn, model.actuator_dyntype)
    rows.words("transmission", transmissions)
    rows.words("target", names.targets)
    second_sites = [
        names.sites[int(second)] if kind in _WITH_SITES and second >= 0 else ""
        for kind, second in zip(transmissions, model.actuator_trnid[:, 1].tolist(), strict=True)
    ]
    rows.words("second site", second_sites)
    crank = model.actuator_trntype == mujoco.mjtTrn.mjTRN_SLIDERCRANK
    rows.numbers("crank length", model.actuator_cranklength, crank)
    rows.words("gear", _gears(model, transmissions))
    for field, kinds, values, counts in (
        ("gain", gains, model.actuator_gainprm, _GAIN_COUNT),
        ("bias", biases, model.actuator_biasprm, _BIAS_COUNT),
        ("dynamics", dynamics, model.actuator_dynprm, _DYN_COUNT),
    ):
        rows.words(f"{field} type", kinds)
        rows.numbers(field, values, counts=[counts.get(kind) for kind in kinds])
    signed = is_any(model.actuator_gaintype, *_GAINS_WITH_INPUTS)
    rows.numbers("inputs", model.actuator_ctrlspec, signed)
    rows.words("control range", _control_ranges(model))
    rows.numbers("force range", model.actuator_forcerange, model.actuator_forcelimited)
    rows.numbers("activation range", model.actuator_actrange, model.actuator_actlimited)
    stateful = model.actuator_actnum > 0
    rows.numbers("early activation", model.actuator_actearly, stateful)
    ranges = _per_output(model, model.actuator_lengthrange)
    muscles = [kind == "muscle" for kind in gains]
    rows.words("length range", [r if m else () for r, m in zip(ranges, muscles, strict=True)])
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
    kinds = words(mujoco.mjtEq, model.eq_type)
    rows.words("type", kinds)
    by_type = {
        "joint": names.joints,
        "tendon": names.tendons,
        "flex": names.flexes,
        "flexstrain": names.flexes,
    }
    # Only points, which may be of bodies or of sites, state what they are fixed to.
    on_sites = is_any(model.eq_objtype, mujoco.mjtObj.mjOBJ_SITE).tolist()
    between: list[tuple[Value, ...]] = []
    for kind, sites, *ends in zip(
        kinds, on_sites, model.eq_obj1id.tolist(), model.eq_obj2id.tolist(), strict=True
    ):
        bound = by_type.get(kind, names.sites if sites else names.bodies)
        between.append(tuple(bound[int(end)] for end in ends if end >= 0))
    rows.words("between", between)
    rows.numbers("active", model.eq_active0)
    rows.numbers("solref", safe_solref(model, model.eq_solref))
    rows.numbers("solimp", model.eq_solimp)
    counts = [_EQUALITY_COUNT.get(kind, _MOST_EQUALITY_COUNT) for kind in kinds]
    rows.numbers("data", model.eq_data, counts=counts)
    return rows.section()


def _per_output(model: mujoco.MjModel, values: NDArray[np.float64]) -> list[tuple[Value, ...]]:
    """Return for each actuator the rows of its force outputs."""
    return [
        tuple((values[start : start + count] + 0.0).ravel().tolist())
        for start, count in zip(
            model.actuator_outadr.tolist(), model.actuator_outnum.tolist(), strict=True
        )
    ]


def _gears(model: mujoco.MjModel, transmissions: list[str]) -> list[tuple[Value, ...]]:
    """Return for each actuator the gear numbers that its transmission reads."""
    joints = words(mujoco.mjtJoint, model.jnt_type)
    return [
        gear[: _JOINT_GEAR_COUNT[joints[target]]]
        if kind in _TO_JOINT
        else gear[: _GEAR_COUNT.get(kind)]
        for gear, kind, target in zip(
            _per_output(model, model.actuator_gear),
            transmissions,
            model.actuator_trnid[:, 0].tolist(),
            strict=True,
        )
    ]


def _control_ranges(model: mujoco.MjModel) -> list[tuple[Value, ...]]:
    """Return for each actuator the ranges of its controls; "free" for one without a limit."""
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
    """Return for each tendon what it passes: kind, name, and coefficient, divisor or side site."""
    passed = {
        "joint": names.joints,
        "site": names.sites,
        "sphere": names.geoms,
        "cylinder": names.geoms,
    }
    stops: list[tuple[Value, ...]] = []
    for kind, what, parameter in zip(
        words(mujoco.mjtWrap, model.wrap_type),
        model.wrap_objid.tolist(),
        (model.wrap_prm + 0.0).tolist(),
        strict=True,
    ):
        name = passed[kind][int(what)] if kind in passed else ""
        last: Value = parameter
        if kind in ("sphere", "cylinder"):
            last = names.sites[int(parameter)] if parameter >= 0.0 else ""
        stops.append((kind, name, last))
    return [
        tuple(value for stop in stops[start : start + count] for value in stop)
        for start, count in zip(model.tendon_adr.tolist(), model.tendon_num.tolist(), strict=True)
    ]
