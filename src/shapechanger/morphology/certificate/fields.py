"""The numbers that decide a compiled model's motion, by one table of its arrays.

`MOVED` names what decides the motion, `SENSED` what else an env or a task may read. An array whose
condition does not hold for an element has no effect on it and is left out, and so are elements
that do nothing: geoms that neither touch nor push a fluid nor guide a tendon, sites that nothing
names, and bodies that carry nothing but those. Joints and actuators stand in the order of the
model, which decides what the numbers of its state and its control mean; all else is sorted by name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

Values = tuple[float | str, ...]
Numbers = dict[str, dict[str, dict[str, Values]]]
"""Numbers and words by section, element and quantity; SI units, angles in rad."""

_O: Final = mujoco.mjtObj
_T: Final = mujoco.mjtTrn
_W: Final = mujoco.mjtWrap
_E: Final = mujoco.mjtEq
_GAIN: Final = mujoco.mjtGain
_DISABLE: Final = mujoco.mjtDisableBit
_ENABLE: Final = mujoco.mjtEnableBit


@dataclass(frozen=True, slots=True)
class Field:
    """One array of `mujoco.MjModel`, of its options (`opt_`), or of `made_arrays`.

    Attributes:
        quantity: Its name in certificates.
        array: Name of the array.
        unit: Unit; of a joint, the units of one that slides and of one that turns, where "deg"
            turns radians into degrees; "1" for a dimensionless number.
        where: Array that is not zero where this one counts.
        of: Enumeration of its values; or the kind of element that they are indices of, or the
            array with the kind of each.
        padded: Whether zeros at its end are numbers that the element does not have.
    """

    quantity: str
    array: str
    unit: str | tuple[str, str] = ""
    where: str = ""
    of: Any = None
    padded: bool = False


@dataclass(frozen=True, slots=True)
class Kind:
    """The elements of a section.

    Attributes:
        title: What one is called in a sentence.
        fields: Its row of the table.
        element: Kind of element, a key of `NAMED`; empty if they are no elements of MuJoCo.
        described_by: Quantity that describes an element which only one of two models has.
        in_order: Whether the order of the elements counts.
    """

    title: str
    fields: tuple[Field, ...]
    element: str = ""
    described_by: str = "type"
    in_order: bool = False


NAMED: Final[dict[str, tuple[mujoco.mjtObj, str]]] = {
    "bodies": (_O.mjOBJ_BODY, "nbody"),
    "joints": (_O.mjOBJ_JOINT, "njnt"),
    "geoms": (_O.mjOBJ_GEOM, "ngeom"),
    "sites": (_O.mjOBJ_SITE, "nsite"),
    "tendons": (_O.mjOBJ_TENDON, "ntendon"),
    "actuators": (_O.mjOBJ_ACTUATOR, "nactuator"),
    "equalities": (_O.mjOBJ_EQUALITY, "neq"),
    "flexes": (_O.mjOBJ_FLEX, "nflex"),
    "sensors": (_O.mjOBJ_SENSOR, "nsensor"),
    "keyframes": (_O.mjOBJ_KEY, "nkey"),
    "custom": (_O.mjOBJ_NUMERIC, "nnumeric"),
    "cameras": (_O.mjOBJ_CAMERA, "ncam"),
}
"""Kinds of elements: MuJoCo's, and the name of their number in a model."""

_GEOM_FIELDS: Final = (
    Field("type", "geom_type", of=mujoco.mjtGeom),
    Field("body", "geom_bodyid", of="bodies"),
    Field("position", "geom_pos", "m"),
    Field("orientation", "geom_quat"),
    Field("size", "geom_size", "m", "geom_sized", padded=True),
    Field("shape", "geom_shape"),
    Field("surface velocity", "geom_surfacevel", "m/s", "geom_slides"),
    Field("fluid coefficients", "geom_fluid", "1", "geom_in_fluid"),
)
_SITE_FIELDS: Final = (
    Field("body", "site_bodyid", of="bodies"),
    Field("position", "site_pos", "m"),
    Field("orientation", "site_quat"),
)
_JOINT_FIELDS: Final = (
    Field("type", "jnt_type", of=mujoco.mjtJoint),
    Field("body", "jnt_bodyid", of="bodies"),
    Field("anchor", "jnt_pos", "m", "jnt_anchored"),
    Field("axis", "jnt_axis", "", "jnt_one_way"),
    Field("rest position", "qpos0", ("m", "rad")),
    Field("joint range", "jnt_range", ("m", "deg"), "jnt_bounded"),
    Field("limit margin", "jnt_margin", ("m", "rad"), "jnt_bounded"),
    Field("limit solref", "jnt_solref", "", "jnt_bounded"),
    Field("limit solimp", "jnt_solimp", "", "jnt_bounded"),
    Field("stiffness", "jnt_stiffness", ("N/m", "N·m/rad")),
    Field("stiffness polynomial", "jnt_stiffnesspoly", "", "jnt_springy"),
    Field("spring yield", "jnt_springyield", "", "jnt_yields"),
    Field("spring reference", "qpos_spring", ("m", "rad"), "jnt_springy"),
    Field("damping", "dof_damping", ("N·s/m", "N·m·s/rad")),
    Field("damping polynomial", "dof_dampingpoly"),
    Field("armature", "dof_armature", ("kg", "kg·m²")),
    Field("friction loss", "dof_frictionloss", ("N", "N·m")),
    Field("friction solref", "dof_solref", "", "dof_frictionloss"),
    Field("friction solimp", "dof_solimp", "", "dof_frictionloss"),
    Field("actuator force range", "jnt_actfrcrange", ("N", "N·m"), "jnt_actfrclimited"),
    Field("gravity compensation by actuators", "jnt_actgravcomp"),
)
CONTACT_FIELDS: Final = (
    Field("contact dimension", "contact_dim"),
    Field("contact friction", "contact_friction", "1", padded=True),
    Field("contact solref", "contact_solref"),
    Field("contact friction solref", "contact_solreffriction", "", "contact_softens"),
    Field("contact solimp", "contact_solimp"),
    Field("contact margin", "contact_margin", "m"),
    Field("contact gap", "contact_gap", "m"),
    Field("contact adhesion", "contact_adhesion", "N"),
)
_ACTUATOR_FIELDS: Final = (
    Field("transmission", "actuator_trntype", of=_T),
    Field("target", "actuator_trnid0", of="actuator_target_kinds"),
    Field("second site", "actuator_trnid1", "", "actuator_has_sites", "sites"),
    Field("crank length", "actuator_cranklength", "m", "actuator_is_crank"),
    Field("gear", "actuator_gear", "1", padded=True),
    Field("gain type", "actuator_gaintype", of=_GAIN),
    Field("gain", "actuator_gainprm", padded=True),
    Field("bias type", "actuator_biastype", of=mujoco.mjtBias),
    Field("bias", "actuator_biasprm", "", "actuator_biastype", padded=True),
    Field("dynamics type", "actuator_dyntype", of=mujoco.mjtDyn),
    Field("dynamics", "actuator_dynprm", "", "actuator_dyntype", padded=True),
    Field("inputs", "actuator_ctrlspec", "", "actuator_has_inputs"),
    Field("control range", "actuator_ctrlrange", "", "actuator_ctrllimited"),
    Field("force range", "actuator_forcerange", "", "actuator_forcelimited"),
    Field("activation range", "actuator_actrange", "", "actuator_actlimited"),
    Field("early activation", "actuator_actearly", "", "actuator_actnum"),
    Field("length range", "actuator_lengthrange", "", "actuator_is_muscle"),
    Field("delay", "actuator_delay", "s", "actuator_delays"),
    Field("delay buffer", "actuator_history", "", "actuator_delays"),
    Field("damping", "actuator_damping", "", "actuator_added"),
    Field("damping polynomial", "actuator_dampingpoly", "", "actuator_added"),
    Field("armature", "actuator_armature", "", "actuator_added"),
    Field("switched off", "actuator_disabled", "", "actuator_disabled"),
)
# A fixed tendon adds lengths and angles as the model pleases, so its numbers have no unit.
_TENDON_FIELDS: Final = (
    Field("path", "wrap_type", of=_W),
    Field("path elements", "wrap_objid", of="wrap_kinds"),
    Field("path side sites", "wrap_side", of="sites"),
    Field("path coefficients", "wrap_coefficient"),
    Field("tendon range", "tendon_range", "", "tendon_limited"),
    Field("limit margin", "tendon_margin", "", "tendon_limited"),
    Field("limit solref", "tendon_solref_lim", "", "tendon_limited"),
    Field("limit solimp", "tendon_solimp_lim", "", "tendon_limited"),
    Field("stiffness", "tendon_stiffness"),
    Field("stiffness polynomial", "tendon_stiffnesspoly", "", "tendon_springy"),
    Field("spring yield", "tendon_springyield", "", "tendon_yields"),
    Field("spring length", "tendon_lengthspring", "", "tendon_springy"),
    Field("damping", "tendon_damping"),
    Field("damping polynomial", "tendon_dampingpoly"),
    Field("armature", "tendon_armature"),
    Field("friction loss", "tendon_frictionloss"),
    Field("friction solref", "tendon_solref_fri", "", "tendon_frictionloss"),
    Field("friction solimp", "tendon_solimp_fri", "", "tendon_frictionloss"),
    Field("actuator force range", "tendon_actfrcrange", "", "tendon_actfrclimited"),
)
_EQUALITY_FIELDS: Final = (
    Field("type", "eq_type", of=_E),
    Field("between", "eq_obj1id", of="eq_kinds"),
    Field("and", "eq_obj2id", of="eq_kinds"),
    Field("active", "eq_active0"),
    Field("solref", "eq_solref"),
    Field("solimp", "eq_solimp"),
    Field("data", "eq_data", padded=True),
)
_BODY_FIELDS: Final = (
    Field("parent", "body_parentid", of="bodies"),
    Field("position", "body_pos", "m", "body_placed"),
    Field("orientation", "body_quat", "", "body_placed"),
    Field("mass", "body_mass", "kg", "body_moves"),
    Field("inertia", "body_inertia", "kg·m²", "body_moves"),
    Field("centre of mass", "body_ipos", "m", "body_moves"),
    Field("inertia axes", "body_iquat", "", "body_moves"),
    Field("gravity compensation", "body_gravcomp", "", "body_floats"),
    Field("mocap", "body_mocap", "", "body_mocap"),
    Field("sleep policy", "body_sleep_policy", "", "body_sleeps"),
)
_OPTION_UNITS: Final = {"timestep": "s", "gravity": "m/s²", "density": "kg/m³", "viscosity": "Pa·s"}
_OPTION_FIELDS: Final = (
    *(Field(name, f"opt_{name}", unit) for name, unit in _OPTION_UNITS.items()),
    *(
        Field(name, f"opt_{name}")
        for name in (
            *("impratio", "tolerance", "ls_tolerance", "noslip_tolerance", "ccd_tolerance"),
            *("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations"),
            *("sdf_initpoints", "sdf_iterations"),
        )
    ),
    Field("wind", "opt_wind", "m/s", "opt_medium"),
    Field("sleep tolerance", "opt_sleep_tolerance", "", "opt_sleeps"),
    Field("integrator", "opt_integrator", of=mujoco.mjtIntegrator),
    Field("cone", "opt_cone", of=mujoco.mjtCone),
    Field("jacobian", "opt_jacobian", of=mujoco.mjtJacobian),
    Field("solver", "opt_solver", of=mujoco.mjtSolver),
    *(
        Field(f"override {name}", f"opt_o_{name}", "", "opt_overrides_flexes")
        for name in ("margin", "solref", "solimp", "friction")
    ),
    Field("switched off", "opt_switched_off"),
    Field("switched on", "opt_switched_on"),
)
_FLEX_FIELDS: Final = tuple(
    Field(name, f"flex_{name}")
    for name in (
        *("contype", "conaffinity", "condim", "priority", "solmix", "solref", "solimp"),
        *("friction", "margin", "gap", "selfcollide", "activelayers", "passive", "dim"),
        *("interp", "radius", "damping", "yield", "edgestiffness", "edgedamping"),
        "edgeequality",
    )
)
_SENSOR_FIELDS: Final = (
    Field("type", "sensor_type", of=mujoco.mjtSensor),
    Field("object", "sensor_objid", of="sensor_object_kinds"),
    Field("reference", "sensor_refid", of="sensor_reference_kinds"),
    *(Field(name, f"sensor_{name}") for name in ("dim", "cutoff", "noise")),
)
_KEY_FIELDS: Final = tuple(
    Field(name, f"key_{name}") for name in ("time", "qpos", "qvel", "act", "ctrl", "mpos", "mquat")
)
_CAMERA_FIELDS: Final = (
    Field("body", "cam_bodyid", of="bodies"),
    *(Field(name, f"cam_{name}") for name in ("pos", "quat", "fovy", "sensorsize", "intrinsic")),
)
MOVED: Final = {
    "options": Kind("option", _OPTION_FIELDS),
    "sizes": Kind("model size", (Field("dimensions", "", "1"),)),
    "bodies": Kind("body", _BODY_FIELDS, "bodies", "mass"),
    "joints": Kind("joint", _JOINT_FIELDS, "joints", in_order=True),
    "geoms": Kind("geom", _GEOM_FIELDS, "geoms"),
    "sites": Kind("site", _SITE_FIELDS, "sites"),
    "contacts": Kind("contact", CONTACT_FIELDS, described_by="contact dimension"),
    "actuators": Kind("actuator", _ACTUATOR_FIELDS, "actuators", "target", in_order=True),
    "tendons": Kind("tendon", _TENDON_FIELDS, "tendons"),
    "equalities": Kind("equality constraint", _EQUALITY_FIELDS, "equalities"),
    "flexes": Kind("flex", _FLEX_FIELDS, "flexes"),
    "whole": Kind("array", ()),
}
"""Sections of what decides the motion; `derived` constants of `mujoco.mj_setConst` follow them."""

SENSED: Final = {
    "places": Kind("geom", _GEOM_FIELDS, "geoms"),
    "marks": Kind("site", _SITE_FIELDS, "sites"),
    "sensors": Kind("sensor", _SENSOR_FIELDS, "sensors", in_order=True),
    "keyframes": Kind("keyframe", _KEY_FIELDS, "keyframes", in_order=True),
    "custom": Kind("custom number", (Field("value", "numeric_data"),), "custom"),
    "cameras": Kind("camera", _CAMERA_FIELDS, "cameras"),
    "drawing": Kind("drawing", ()),
}
"""Sections of what an env or a task may read besides, the last two where frames are observed."""

# Switches that decide what is computed besides the motion, or that contacts and limits have already
# taken into account.
_QUIET: Final = (
    *(_DISABLE.mjDSBL_SENSOR, _DISABLE.mjDSBL_MIDPHASE, _ENABLE.mjENBL_ENERGY),
    _ENABLE.mjENBL_FWDINV,
)
_WITHOUT_FLEXES: Final = (
    *(_DISABLE.mjDSBL_CONTACT, _DISABLE.mjDSBL_FILTERPARENT, _DISABLE.mjDSBL_REFSAFE),
    _ENABLE.mjENBL_OVERRIDE,
)


def made_arrays(m: mujoco.MjModel) -> dict[str, Any]:
    """Return the arrays of the table that MuJoCo does not have; see `numbers` for contacts.

    Args:
        m: The model.
    """
    option, joints = m.opt, mujoco.mjtJoint
    moves, free = m.body_treeid >= 0, m.jnt_type == joints.mjJNT_FREE
    medium = option.density > 0.0 or option.viscosity > 0.0
    sleeps = bool(option.enableflags & _ENABLE.mjENBL_SLEEP)
    overrides = m.nflex > 0 and bool(option.enableflags & _ENABLE.mjENBL_OVERRIDE)
    wraps = np.isin(m.wrap_type, (int(_W.mjWRAP_SPHERE), int(_W.mjWRAP_CYLINDER)))
    policies = np.zeros(m.nbody)
    policies[m.tree_bodyadr] = m.tree_sleep_policy
    found = {
        "opt_medium": np.array([medium]),
        "opt_sleeps": np.array([sleeps]),
        "opt_overrides_flexes": np.array([overrides]),
        "opt_switched_off": _switches(m, _DISABLE, option.disableflags),
        "opt_switched_on": _switches(m, _ENABLE, option.enableflags),
        "body_moves": moves,
        # A free body starts from the `qpos0` of its joint.
        "body_placed": ~np.isin(np.arange(m.nbody), m.jnt_bodyid[free]),
        "body_floats": moves & (m.body_gravcomp != 0.0) & m.flg_gravcomp,
        "body_mocap": m.body_mocapid >= 0,
        "body_sleep_policy": policies,
        "body_sleeps": moves & sleeps,
        "jnt_anchored": ~free,
        "jnt_one_way": np.isin(m.jnt_type, (int(joints.mjJNT_SLIDE), int(joints.mjJNT_HINGE))),
        "jnt_bounded": (m.jnt_limited != 0) & ~free,
        # A plane's size is drawn, but has no effect on collisions.
        "geom_sized": m.geom_type != mujoco.mjtGeom.mjGEOM_PLANE,
        "geom_slides": m.geom_surfacevel.any(axis=1) & m.flg_surfacevel,
        # A fluid pushes on these by the ellipsoid model.
        "geom_in_fluid": (m.geom_fluid[:, 0] > 0.0) & medium,
        "wrap_side": np.where(wraps, m.wrap_prm, -1.0).astype(np.int64),
        "wrap_coefficient": np.where(wraps, 0.0, m.wrap_prm),
        "actuator_trnid0": m.actuator_trnid[:, 0],
        "actuator_trnid1": m.actuator_trnid[:, 1],
        "actuator_is_crank": m.actuator_trntype == _T.mjTRN_SLIDERCRANK,
        "actuator_is_muscle": m.actuator_gaintype == _GAIN.mjGAIN_MUSCLE,
        "actuator_delays": m.actuator_historyadr >= 0,
        "actuator_disabled": (option.disableactuator >> m.actuator_group.clip(0, 30)) & 1,
        "actuator_has_sites": np.isin(
            m.actuator_trntype,
            [_T.mjTRN_SITE.value, _T.mjTRN_SLIDERCRANK.value, _T.mjTRN_SO3.value],
        ),
        # Their signature chooses what their controls are.
        "actuator_has_inputs": np.isin(
            m.actuator_gaintype,
            [_GAIN.mjGAIN_SO3.value, _GAIN.mjGAIN_PID.value, _GAIN.mjGAIN_DCMOTOR.value],
        ),
        # Their joint or tendon knows of their damping and armature.
        "actuator_added": np.isin(
            np.arange(m.nactuator), np.concatenate([m.jnt_actuatorid, m.tendon_actuatorid])
        ),
    }
    for of in ("jnt", "tendon"):
        springy = getattr(m, f"{of}_stiffness") != 0.0
        found[f"{of}_springy"] = springy | getattr(m, f"{of}_stiffnesspoly").any(axis=1)
        found[f"{of}_yields"] = found[f"{of}_springy"] & (getattr(m, f"{of}_plasticadr") >= 0)
    return found | kinds_of(m)


def _switches(m: mujoco.MjModel, enumeration: Any, bits: int) -> NDArray[np.str_]:
    """Return the words of the switches that are set and act."""
    quiet = _QUIET if m.nflex else (*_QUIET, *_WITHOUT_FLEXES)
    members = [each for each in enumeration.__members__.values() if each not in quiet]
    named = [each for each in members if each.name.startswith(("mjDSBL", "mjENBL"))]
    return np.array(
        [each.name.partition("_")[2].lower() for each in named if bits & each.value], np.str_
    )


def kinds_of(m: mujoco.MjModel) -> dict[str, list[str]]:
    """Return the kinds of the elements that indices of several kinds are of; "" for none.

    Args:
        m: The model.
    """
    targets = {_T.mjTRN_TENDON: "tendons", _T.mjTRN_SITE: "sites", _T.mjTRN_SLIDERCRANK: "sites"}
    targets |= {_T.mjTRN_BODY: "bodies"}
    passed = {_W.mjWRAP_JOINT: "joints", _W.mjWRAP_SITE: "sites", _W.mjWRAP_PULLEY: ""}
    bound = {_E.mjEQ_JOINT: "joints", _E.mjEQ_TENDON: "tendons"}
    by_object = {element[0].value: kind for kind, element in NAMED.items()}
    by_object[_O.mjOBJ_XBODY.value] = "bodies"
    pins = (_E.mjEQ_CONNECT, _E.mjEQ_WELD)
    pairs = zip(m.eq_type.tolist(), m.eq_objtype.tolist(), strict=True)
    ends = zip(m.actuator_trntype.tolist(), m.actuator_trnid[:, 1].tolist(), strict=True)
    return {
        "actuator_target_kinds": [
            # `so3` drives a ball joint, or a site with its reference site.
            "sites" if kind == _T.mjTRN_SO3 and end >= 0 else targets.get(_T(kind), "joints")
            for kind, end in ends
        ],
        "wrap_kinds": [passed.get(_W(kind), "geoms") for kind in m.wrap_type.tolist()],
        "eq_kinds": [
            by_object.get(on, "bodies") if kind in pins else bound.get(_E(kind), "flexes")
            for kind, on in pairs
        ],
        "sensor_object_kinds": [by_object.get(kind, "") for kind in m.sensor_objtype.tolist()],
        "sensor_reference_kinds": [by_object.get(kind, "") for kind in m.sensor_reftype.tolist()],
    }
