"""The numbers that decide a compiled model's motion, by one table of its arrays.

`MOVED` names what decides the motion, `SENSED` what else an env or a task may read. An array whose
condition does not hold for an element has no effect on it and is left out, and so are elements
that do nothing: geoms that neither touch nor push a fluid nor guide a tendon, sites that nothing
names, and bodies that carry nothing but those. Joints and actuators stand in the order of the
model, which decides what the numbers of its state and its control mean; all else is sorted by name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

Values = tuple[float | str, ...]
Numbers = dict[str, dict[str, dict[str, Values]]]
"""Numbers and words by section, element and quantity; SI units, angles in rad."""

_Condition = str | Callable[[mujoco.MjModel], Any]
_O: Final = mujoco.mjtObj
_J: Final = mujoco.mjtJoint
_T: Final = mujoco.mjtTrn
_W: Final = mujoco.mjtWrap
_E: Final = mujoco.mjtEq


@dataclass(frozen=True, slots=True)
class Field:
    """One array of `mujoco.MjModel`, or of `contact_arrays`; `opt_` stands for its options.

    Attributes:
        quantity: Its name in certificates.
        array: Name of the array.
        unit: Unit; of a joint, that of one that slides and of one that turns, where "deg" turns
            radians into degrees; "1" for a dimensionless number.
        where: Condition for it to count: an array that is not zero, or a function that returns a
            mask; by element or by row of the array.
        of: Enumeration of its values; or the kind of element that they are indices of, or a
            function that returns the kind of each.
        padded: Whether zeros at its end are numbers that the element does not have.
    """

    quantity: str
    array: str
    unit: str | tuple[str, str] = ""
    where: _Condition = ""
    of: Any = None
    padded: bool = False


@dataclass(frozen=True, slots=True)
class Kind:
    """The elements of a section.

    Attributes:
        title: What one is called in a sentence.
        fields: Its row of the table.
        element: Kind of the elements in MuJoCo, and the name of their number in a model.
        described_by: Quantity that describes an element which only one of two models has.
        in_order: Whether the order of the elements counts.
    """

    title: str
    fields: tuple[Field, ...]
    element: tuple[mujoco.mjtObj, str] | None = None
    described_by: str = "type"
    in_order: bool = False


def moving(m: mujoco.MjModel) -> Any:
    """Return the bodies that can move, shape (nbody,)."""
    return m.body_treeid >= 0


def _fixed_or_jointed(m: mujoco.MjModel) -> Any:
    """Return which bodies are placed by the model; free ones start from the `qpos0` of theirs."""
    return ~np.isin(np.arange(m.nbody), m.jnt_bodyid[m.jnt_type == _J.mjJNT_FREE])


def _springy(m: mujoco.MjModel, of: str = "jnt") -> Any:
    polynomial = getattr(m, f"{of}_stiffnesspoly")
    return (getattr(m, f"{of}_stiffness") != 0.0) | polynomial.any(axis=1)


def _yielding(m: mujoco.MjModel, of: str = "jnt") -> Any:
    return _springy(m, of) & (getattr(m, f"{of}_plasticadr") >= 0)


def _of_free(m: mujoco.MjModel) -> Any:
    return m.jnt_type == _J.mjJNT_FREE


def _one_way(m: mujoco.MjModel) -> Any:
    return np.isin(m.jnt_type, (int(_J.mjJNT_SLIDE), int(_J.mjJNT_HINGE)))


def _limited(m: mujoco.MjModel) -> Any:
    return (m.jnt_limited != 0) & ~_of_free(m)


def in_fluid(m: mujoco.MjModel) -> NDArray[np.bool_]:
    """Return the geoms on which a fluid pushes by the ellipsoid model, shape (ngeom,)."""
    medium = m.opt.density > 0.0 or m.opt.viscosity > 0.0
    return (m.geom_fluid[:, 0] > 0.0) & medium


def _added(m: mujoco.MjModel) -> Any:
    """Return the actuators whose damping and armature their joint or tendon knows of."""
    users = np.concatenate([m.jnt_actuatorid, m.tendon_actuatorid])
    return np.isin(np.arange(m.nactuator), users)


def _has_inputs(m: mujoco.MjModel) -> Any:
    """Return the actuators whose signature chooses what their controls are."""
    gains = mujoco.mjtGain
    chosen = (gains.mjGAIN_SO3, gains.mjGAIN_PID, gains.mjGAIN_DCMOTOR)
    return np.isin(m.actuator_gaintype, [int(gain) for gain in chosen])


def targets_of(m: mujoco.MjModel) -> list[str]:
    """Return the kind of element that each actuator drives."""
    kinds = {_T.mjTRN_TENDON: "tendons", _T.mjTRN_SITE: "sites", _T.mjTRN_SLIDERCRANK: "sites"}
    kinds |= {_T.mjTRN_BODY: "bodies"}
    pairs = zip(m.actuator_trntype.tolist(), m.actuator_trnid[:, 1].tolist(), strict=True)
    return [
        # `so3` drives a ball joint, or a site with its reference site.
        "sites" if kind == _T.mjTRN_SO3 and second >= 0 else kinds.get(_T(kind), "joints")
        for kind, second in pairs
    ]


def _with_sites(m: mujoco.MjModel) -> Any:
    with_sites = (_T.mjTRN_SITE, _T.mjTRN_SLIDERCRANK, _T.mjTRN_SO3)
    return np.isin(m.actuator_trntype, [int(kind) for kind in with_sites])


def _passed(m: mujoco.MjModel) -> list[str]:
    """Return the kind of element that each part of a tendon's path passes."""
    kinds = {_W.mjWRAP_JOINT: "joints", _W.mjWRAP_SITE: "sites", _W.mjWRAP_PULLEY: ""}
    return [kinds.get(_W(kind), "geoms") for kind in m.wrap_type.tolist()]


def _bound(m: mujoco.MjModel) -> list[str]:
    """Return the kind of element that each equality binds."""
    kinds = {_E.mjEQ_JOINT: "joints", _E.mjEQ_TENDON: "tendons"}
    points = {int(_O.mjOBJ_BODY): "bodies", int(_O.mjOBJ_SITE): "sites"}
    pairs = zip(m.eq_type.tolist(), m.eq_objtype.tolist(), strict=True)
    return [
        points.get(on, "bodies")
        if kind in (_E.mjEQ_CONNECT, _E.mjEQ_WELD)
        else kinds.get(_E(kind), "flexes")
        for kind, on in pairs
    ]


def _sensed_by(array: str) -> Callable[[mujoco.MjModel], list[str]]:
    kinds = {element[0].value: section for section, element in NAMED.items()}
    kinds[_O.mjOBJ_XBODY.value] = "bodies"
    return lambda m: [kinds.get(kind, "") for kind in getattr(m, array).tolist()]


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
_GEOM_FIELDS: Final = (
    Field("type", "geom_type", of=mujoco.mjtGeom),
    Field("body", "geom_bodyid", of="bodies"),
    Field("position", "geom_pos", "m"),
    Field("orientation", "geom_quat"),
    # A plane's size is drawn, but has no effect on collisions.
    Field(
        "size", "geom_size", "m", lambda m: m.geom_type != mujoco.mjtGeom.mjGEOM_PLANE, None, True
    ),
    Field("shape", "geom_shape"),
    Field(
        "surface velocity",
        "geom_surfacevel",
        "m/s",
        lambda m: m.geom_surfacevel.any(axis=1) & m.flg_surfacevel,
    ),
    Field("fluid coefficients", "geom_fluid", "1", in_fluid),
)
_SITE_FIELDS: Final = (
    Field("body", "site_bodyid", of="bodies"),
    Field("position", "site_pos", "m"),
    Field("orientation", "site_quat"),
)
_JOINT_FIELDS: Final = (
    Field("type", "jnt_type", of=mujoco.mjtJoint),
    Field("body", "jnt_bodyid", of="bodies"),
    Field("anchor", "jnt_pos", "m", lambda m: ~_of_free(m)),
    Field("axis", "jnt_axis", "", _one_way),
    Field("rest position", "qpos0", ("m", "rad")),
    Field("joint range", "jnt_range", ("m", "deg"), _limited),
    Field("limit margin", "jnt_margin", ("m", "rad"), _limited),
    Field("limit solref", "jnt_solref", "", _limited),
    Field("limit solimp", "jnt_solimp", "", _limited),
    Field("stiffness", "jnt_stiffness", ("N/m", "N·m/rad")),
    Field("stiffness polynomial", "jnt_stiffnesspoly", "", _springy),
    Field("spring yield", "jnt_springyield", "", _yielding),
    Field("spring reference", "qpos_spring", ("m", "rad"), _springy),
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
    Field("contact friction", "contact_friction", "1", "", None, True),
    Field("contact solref", "contact_solref"),
    Field("contact friction solref", "contact_solreffriction", "", "contact_softens"),
    Field("contact solimp", "contact_solimp"),
    Field("contact margin", "contact_margin", "m"),
    Field("contact gap", "contact_gap", "m"),
    Field("contact adhesion", "contact_adhesion", "N"),
)
ACTUATOR_FIELDS: Final = (
    Field("transmission", "actuator_trntype", of=mujoco.mjtTrn),
    Field("target", "actuator_trnid0", of=targets_of),
    Field("second site", "actuator_trnid1", "", _with_sites, "sites"),
    Field(
        "crank length",
        "actuator_cranklength",
        "m",
        lambda m: m.actuator_trntype == _T.mjTRN_SLIDERCRANK,
    ),
    Field("gear", "actuator_gear", "1", padded=True),
    Field("gain type", "actuator_gaintype", of=mujoco.mjtGain),
    Field("gain", "actuator_gainprm", padded=True),
    Field("bias type", "actuator_biastype", of=mujoco.mjtBias),
    Field("bias", "actuator_biasprm", "", lambda m: m.actuator_biastype > 0, None, True),
    Field("dynamics type", "actuator_dyntype", of=mujoco.mjtDyn),
    Field("dynamics", "actuator_dynprm", "", lambda m: m.actuator_dyntype > 0, None, True),
    Field("inputs", "actuator_ctrlspec", "", _has_inputs),
    Field("control range", "actuator_ctrlrange", "", "actuator_ctrllimited"),
    Field("force range", "actuator_forcerange", "", "actuator_forcelimited"),
    Field("activation range", "actuator_actrange", "", "actuator_actlimited"),
    Field("early activation", "actuator_actearly", "", "actuator_actnum"),
    Field(
        "length range",
        "actuator_lengthrange",
        "",
        lambda m: m.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE,
    ),
    Field("delay", "actuator_delay", "s", lambda m: m.actuator_historyadr >= 0),
    Field("delay buffer", "actuator_history", "", lambda m: m.actuator_historyadr >= 0),
    Field("damping", "actuator_damping", "", _added),
    Field("damping polynomial", "actuator_dampingpoly", "", _added),
    Field("armature", "actuator_armature", "", _added),
    Field("switched off", "actuator_disabled", "", "actuator_disabled"),
)
# A fixed tendon adds lengths and angles as the model pleases, so its numbers have no unit.
TENDON_FIELDS: Final = (
    Field("path", "wrap_type", of=mujoco.mjtWrap),
    Field("path elements", "wrap_objid", of=_passed),
    Field("path side sites", "wrap_side", of="sites"),
    Field("path coefficients", "wrap_coefficient"),
    Field("tendon range", "tendon_range", "", "tendon_limited"),
    Field("limit margin", "tendon_margin", "", "tendon_limited"),
    Field("limit solref", "tendon_solref_lim", "", "tendon_limited"),
    Field("limit solimp", "tendon_solimp_lim", "", "tendon_limited"),
    Field("stiffness", "tendon_stiffness"),
    Field("stiffness polynomial", "tendon_stiffnesspoly", "", lambda m: _springy(m, "tendon")),
    Field("spring yield", "tendon_springyield", "", lambda m: _yielding(m, "tendon")),
    Field("spring length", "tendon_lengthspring", "", lambda m: _springy(m, "tendon")),
    Field("damping", "tendon_damping"),
    Field("damping polynomial", "tendon_dampingpoly"),
    Field("armature", "tendon_armature"),
    Field("friction loss", "tendon_frictionloss"),
    Field("friction solref", "tendon_solref_fri", "", "tendon_frictionloss"),
    Field("friction solimp", "tendon_solimp_fri", "", "tendon_frictionloss"),
    Field("actuator force range", "tendon_actfrcrange", "", "tendon_actfrclimited"),
)
EQUALITY_FIELDS: Final = (
    Field("type", "eq_type", of=mujoco.mjtEq),
    Field("between", "eq_obj1id", of=_bound),
    Field("and", "eq_obj2id", of=_bound),
    Field("active", "eq_active0"),
    Field("solref", "eq_solref"),
    Field("solimp", "eq_solimp"),
    Field("data", "eq_data", padded=True),
)


def _asleep(m: mujoco.MjModel) -> Any:
    return moving(m) & bool(m.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP)


_BODY_FIELDS: Final = (
    Field("parent", "body_parentid", of="bodies"),
    Field("position", "body_pos", "m", _fixed_or_jointed),
    Field("orientation", "body_quat", "", _fixed_or_jointed),
    Field("mass", "body_mass", "kg", moving),
    Field("inertia", "body_inertia", "kg·m²", moving),
    Field("centre of mass", "body_ipos", "m", moving),
    Field("inertia axes", "body_iquat", "", moving),
    Field(
        "gravity compensation",
        "body_gravcomp",
        "",
        lambda m: moving(m) & (m.body_gravcomp != 0.0) & m.flg_gravcomp,
    ),
    Field("mocap", "body_mocap", "", "body_mocap"),
    Field("sleep policy", "body_sleep_policy", "", _asleep),
)
OPTIONS: Final = (
    *(
        Field(name, f"opt_{name}", unit)
        for name, unit in (
            ("timestep", "s"),
            ("gravity", "m/s²"),
            ("density", "kg/m³"),
            ("viscosity", "Pa·s"),
            ("impratio", ""),
            ("tolerance", ""),
            ("ls_tolerance", ""),
            ("noslip_tolerance", ""),
            ("ccd_tolerance", ""),
            ("iterations", ""),
            ("ls_iterations", ""),
            ("noslip_iterations", ""),
            ("ccd_iterations", ""),
            ("sdf_initpoints", ""),
            ("sdf_iterations", ""),
        )
    ),
    Field("wind", "opt_wind", "m/s", lambda m: [m.opt.density > 0.0 or m.opt.viscosity > 0.0]),
    Field(
        "sleep tolerance",
        "opt_sleep_tolerance",
        "",
        lambda m: [bool(m.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP)],
    ),
    Field("integrator", "opt_integrator", of=mujoco.mjtIntegrator),
    Field("cone", "opt_cone", of=mujoco.mjtCone),
    Field("jacobian", "opt_jacobian", of=mujoco.mjtJacobian),
    Field("solver", "opt_solver", of=mujoco.mjtSolver),
    *(
        Field(
            f"override {name}",
            f"opt_o_{name}",
            "",
            lambda m: [m.nflex > 0 and m.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE],
        )
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
MOVED: Final = {
    "options": Kind("option", OPTIONS),
    "sizes": Kind("model size", (Field("dimensions", "", "1"),)),
    "bodies": Kind("body", _BODY_FIELDS, NAMED["bodies"], "mass"),
    "joints": Kind("joint", _JOINT_FIELDS, NAMED["joints"], in_order=True),
    "geoms": Kind("geom", _GEOM_FIELDS, NAMED["geoms"]),
    "sites": Kind("site", _SITE_FIELDS, NAMED["sites"]),
    "contacts": Kind("contact", CONTACT_FIELDS, described_by="contact dimension"),
    "actuators": Kind("actuator", ACTUATOR_FIELDS, NAMED["actuators"], "target", in_order=True),
    "tendons": Kind("tendon", TENDON_FIELDS, NAMED["tendons"]),
    "equalities": Kind("equality constraint", EQUALITY_FIELDS, NAMED["equalities"]),
    "flexes": Kind("flex", _FLEX_FIELDS, NAMED["flexes"]),
    "whole": Kind("array", ()),
}
"""Sections of what decides the motion; `derived` constants of `mujoco.mj_setConst` follow them."""

SENSED: Final = {
    "places": Kind("geom", _GEOM_FIELDS, NAMED["geoms"]),
    "marks": Kind("site", _SITE_FIELDS, NAMED["sites"]),
    "sensors": Kind(
        "sensor",
        (
            Field("type", "sensor_type", of=mujoco.mjtSensor),
            Field("object", "sensor_objid", of=_sensed_by("sensor_objtype")),
            Field("reference", "sensor_refid", of=_sensed_by("sensor_reftype")),
            *(Field(name, f"sensor_{name}") for name in ("dim", "cutoff", "noise")),
        ),
        NAMED["sensors"],
        in_order=True,
    ),
    "keyframes": Kind(
        "keyframe",
        tuple(
            Field(name, f"key_{name}")
            for name in ("time", "qpos", "qvel", "act", "ctrl", "mpos", "mquat")
        ),
        NAMED["keyframes"],
        in_order=True,
    ),
    "custom": Kind("custom number", (Field("value", "numeric_data"),), NAMED["custom"]),
    "cameras": Kind(
        "camera",
        (
            Field("body", "cam_bodyid", of="bodies"),
            *(
                Field(name, f"cam_{name}")
                for name in ("pos", "quat", "fovy", "sensorsize", "intrinsic")
            ),
        ),
        NAMED["cameras"],
    ),
    "drawing": Kind("drawing", ()),
}
"""Sections of what an env or a task may read besides, the last two where frames are observed."""
