"""Everything in a compiled model that decides how it moves, and nothing that does not.

Two models may differ in colour, in the friction of a foot that stands on a rougher floor, or in the
range of a joint that has no limit, and still do the same. An `EffectiveModel` omits all of that and
holds the rest as plain names and numbers: equal effective models move equally.

It omits sensors and cameras, which decide what is seen of the motion, and keyframes and custom
numbers, which decide nothing by themselves. What an environment makes of those shows in a rollout
(see `shapechanger.morphology.certificate.certify`).
"""

from __future__ import annotations

import hashlib
import struct
from typing import Any, Final

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective import bodies, drive
from shapechanger.morphology.effective.contacts import colliding_pairs, contacts, geoms_of_pairs
from shapechanger.morphology.effective.elements import (
    Names,
    Rows,
    Section,
    Value,
    is_any,
    names_of,
    numbered,
    rounded,
    scales,
    word,
)

_Bools = NDArray[np.bool_]
_DISABLE: Final = mujoco.mjtDisableBit
_ENABLE: Final = mujoco.mjtEnableBit
# Switches that decide what is computed besides the motion, or that contacts and limits of the
# effective model have already taken into account.
_QUIET_SWITCHES: Final = frozenset(
    (
        _DISABLE.mjDSBL_SENSOR,
        _DISABLE.mjDSBL_MIDPHASE,
        _DISABLE.mjDSBL_CONTACT,
        _DISABLE.mjDSBL_FILTERPARENT,
        _DISABLE.mjDSBL_REFSAFE,
        _ENABLE.mjENBL_ENERGY,
        _ENABLE.mjENBL_FWDINV,
        _ENABLE.mjENBL_OVERRIDE,
    )
)
_NUMBERS: Final = (
    "timestep",
    "gravity",
    "density",
    "viscosity",
    "impratio",
    "tolerance",
    "ls_tolerance",
    "noslip_tolerance",
    "ccd_tolerance",
    "iterations",
    "ls_iterations",
    "noslip_iterations",
    "ccd_iterations",
    "sdf_initpoints",
    "sdf_iterations",
)
_CHOICES: Final[dict[str, Any]] = {
    "integrator": mujoco.mjtIntegrator,
    "cone": mujoco.mjtCone,
    "jacobian": mujoco.mjtJacobian,
    "solver": mujoco.mjtSolver,
}
_OVERRIDES: Final = ("o_margin", "o_solref", "o_solimp", "o_friction")
_SIZES: Final = ("nq", "nv", "nu", "na")

# Arrays with one row per flex; the rest of a flex is compared by a digest.
_FLEX_FIELDS: Final = (
    "contype",
    "conaffinity",
    "condim",
    "priority",
    "solmix",
    "solref",
    "solimp",
    "friction",
    "margin",
    "gap",
    "selfcollide",
    "activelayers",
    "passive",
    "dim",
    "interp",
    "radius",
    "damping",
    "yield",
    "edgestiffness",
    "edgedamping",
    "edgeequality",
)
_FLEX_ARRAYS: Final = (
    "flex_vertbodyid",
    "flex_nodebodyid",
    "flex_elem",
    "flex_vert",
    "flex_node",
    "flex_stiffness",
    "flex_bending",
    "flexedge_length0",
)
_DERIVED: Final = (
    "dof_invweight0",
    "dof_M0",
    "tendon_length0",
    "tendon_invweight0",
    "actuator_length0",
    "actuator_acc0",
)


class EffectiveModel(msgspec.Struct, frozen=True):
    """Effective model: all that decides motion, as names and numbers in SI units, angles in rad.

    Joints and actuators stand in the order of the model, which decides what the numbers of its
    state and its control mean; everything else is sorted by name.

    Attributes:
        sections: ((section, ((element, ((field, values), ...)), ...)), ...).
    """

    sections: tuple[tuple[str, Section], ...]

    def __getitem__(self, section: str) -> dict[str, dict[str, tuple[Value, ...]]]:
        """Return the fields of each element of a section.

        Raises:
            KeyError: If there is no such section.
        """
        return {element: dict(fields) for element, fields in dict(self.sections)[section]}


def effective_model(model: mujoco.MjModel, *, anonymous: bool = False) -> EffectiveModel:
    """Extract everything that decides the motion of a compiled model.

    The sections are `options`, `sizes`, `bodies`, `joints`, `geoms`, `sites`, `contacts`,
    `actuators`, `tendons`, `equalities`, `flexes`, `plugins` and `derived`. The last holds what
    MuJoCo computes from the rest; it differs alone only where a compiled model was written to
    without `mujoco.mj_setConst`.

    Args:
        model: The compiled model.
        anonymous: Whether elements are numbered in the order of the model in place of their names.
    """
    geoms, sites = _relevant_geoms(model), _relevant_sites(model)
    carrying = np.zeros(model.nbody, np.bool_)
    carrying[model.geom_bodyid[geoms]] = True
    carrying[model.site_bodyid[sites]] = True
    carrying[_bound_bodies(model)] = True
    kept = bodies.bodies_that_matter(model, carrying)
    # The world comes first, whatever else matters.
    first = kept | (np.arange(model.nbody) == 0)
    names = numbered(model, first, geoms, sites) if anonymous else names_of(model)
    return EffectiveModel(
        (
            ("options", _options(model)),
            ("sizes", _sizes(model)),
            ("bodies", bodies.bodies(model, names, kept)),
            ("joints", bodies.joints(model, names)),
            ("geoms", bodies.geoms(model, names, geoms)),
            ("sites", bodies.sites(model, names, sites)),
            ("contacts", contacts(model, names)),
            ("actuators", drive.actuators(model, names)),
            ("tendons", drive.tendons(model, names)),
            ("equalities", drive.equalities(model, names)),
            ("flexes", _flexes(model, names)),
            ("plugins", _plugins(model)),
            ("derived", _derived(model, kept, geoms)),
        )
    )


def _relevant_geoms(model: mujoco.MjModel) -> _Bools:
    """Return the geoms that touch, push a fluid or guide a tendon, shape (ngeom,)."""
    explicit, dynamic = colliding_pairs(model)
    relevant = np.zeros(model.ngeom, np.bool_)
    relevant[geoms_of_pairs(model, explicit)] = True
    relevant[dynamic] = True
    relevant |= bodies.in_fluid(model)
    around = is_any(model.wrap_type, mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER)
    relevant[model.wrap_objid[around]] = True
    if model.nflex:  # Any geom that can touch may touch a flex.
        relevant |= (model.geom_contype | model.geom_conaffinity) != 0
    return relevant


def _relevant_sites(model: mujoco.MjModel) -> _Bools:
    """Return the sites to which a tendon, an actuator or a constraint is fixed, shape (nsite,)."""
    relevant = np.zeros(model.nsite, np.bool_)
    wrap, transmission = mujoco.mjtWrap, mujoco.mjtTrn
    relevant[model.wrap_objid[model.wrap_type == wrap.mjWRAP_SITE]] = True
    around = is_any(model.wrap_type, wrap.mjWRAP_SPHERE, wrap.mjWRAP_CYLINDER)
    relevant[model.wrap_prm[around & (model.wrap_prm >= 0.0)].astype(np.int64)] = True
    on_sites = is_any(
        model.actuator_trntype,
        transmission.mjTRN_SITE,
        transmission.mjTRN_SLIDERCRANK,
        transmission.mjTRN_SO3,
    )
    # A servo on a ball joint has no second site, and its first number is a joint.
    on_sites &= (model.actuator_trntype != transmission.mjTRN_SO3) | (
        model.actuator_trnid[:, 1] >= 0
    )
    used = model.actuator_trnid[on_sites]
    relevant[used[used >= 0]] = True
    bound = model.eq_objtype == mujoco.mjtObj.mjOBJ_SITE
    relevant[np.concatenate([model.eq_obj1id[bound], model.eq_obj2id[bound]])] = True
    return relevant


def _bound_bodies(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the bodies that an equality constraint binds or an adhesion actuator drives."""
    bound = model.eq_objtype == mujoco.mjtObj.mjOBJ_BODY
    sticky = model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY
    return np.concatenate(
        [model.eq_obj1id[bound], model.eq_obj2id[bound], model.actuator_trnid[sticky, 0]]
    ).astype(np.int64)


def _options(model: mujoco.MjModel) -> Section:
    """Return timestep, gravity, medium and solver options."""
    option = model.opt
    rows = Rows(("simulation",))
    for name in _NUMBERS:
        rows.numbers(name.replace("_", " "), getattr(option, name))
    if option.density > 0.0 or option.viscosity > 0.0:
        rows.numbers("wind", option.wind)
    if option.enableflags & _ENABLE.mjENBL_SLEEP:
        rows.numbers("sleep tolerance", option.sleep_tolerance)
    for name, enumeration in _CHOICES.items():
        rows.words(name, [word(enumeration(getattr(option, name)))])
    quiet = _QUIET_SWITCHES if model.nflex == 0 else frozenset[object]()
    for switches, set_bits in ((_DISABLE, option.disableflags), (_ENABLE, option.enableflags)):
        for switch in switches.__members__.values():
            if switch not in quiet and switch.name.startswith(("mjDSBL", "mjENBL")):
                # A switch that is off and one that an older MuJoCo lacks are the same.
                prefix = "without" if switches is _DISABLE else "with"
                set_here = "yes" if set_bits & switch.value else ""
                rows.words(f"{prefix} {word(switch)}", [set_here])
    if model.nflex and option.enableflags & _ENABLE.mjENBL_OVERRIDE:
        for name in _OVERRIDES:
            rows.numbers(f"override {name[2:]}", getattr(option, name))
    return rows.section()


def _sizes(model: mujoco.MjModel) -> Section:
    """Return the sizes of position, velocity, control and activation."""
    rows = Rows(_SIZES)
    rows.numbers("dimensions", [getattr(model, name) for name in _SIZES])
    return rows.section(in_order=True)


def _flexes(model: mujoco.MjModel, names: Names) -> Section:
    """Return the soft bodies, with their own contact parameters rather than the combined ones."""
    if not model.nflex:
        return ()
    rows = Rows(names.flexes)
    for name in _FLEX_FIELDS:
        rows.numbers(name, getattr(model, f"flex_{name}"))
    shape = bodies.digest(*(getattr(model, name) for name in _FLEX_ARRAYS))
    return (*rows.section(), ("all flexes", (("shape", (shape,)),)))


def _plugins(model: mujoco.MjModel) -> Section:
    """Return the engine plugins that the model uses, by a digest of their configuration."""
    if not model.nplugin:
        return ()
    used = bodies.digest(
        model.plugin,
        np.frombuffer(bytes(model.plugin_attr), np.uint8),
        model.body_plugin,
        model.geom_plugin,
        model.actuator_plugin,
    )
    return (("all plugins", (("configuration", (used,)),)),)


def _derived(model: mujoco.MjModel, kept: _Bools, geoms: _Bools) -> Section:
    """Return the constants of `mujoco.mj_setConst` that the solver relies on.

    Args:
        model: The compiled model.
        kept: Bodies that matter, shape (nbody,).
        geoms: Geoms that matter, shape (ngeom,).
    """
    moving = kept & (model.body_treeid >= 0)
    arrays = {
        name: getattr(model, name)[moving] for name in ("body_subtreemass", "body_invweight0")
    }
    arrays |= {name: getattr(model, name) for name in _DERIVED}
    arrays["body_margin"] = model.body_margin[kept]
    arrays["geom_rbound"] = model.geom_rbound[geoms]
    arrays["meaninertia"] = np.asarray([model.stat.meaninertia])
    return tuple(
        (name, (("values", tuple((values + 0.0).ravel().tolist())),))
        for name, values in arrays.items()
    )


# 64 bits: the chance that two of a million different models collide is 1 in 37 million.
_HEX_DIGITS: Final = 16


def fingerprint(model: mujoco.MjModel) -> str:
    """Return the first 16 hex digits of the SHA-256 of the effective model of a compiled model.

    It is the same in every process and on every machine, whose compilers and processors may round
    differently: numbers count up to rounding. It does not change with colours, cameras, lights, or
    anything else without effect.
    """
    return digest_of(effective_model(model).sections)


def digest_of(sections: tuple[tuple[str, Section], ...]) -> str:
    """Return the first 16 hex digits of the SHA-256 of sections, with their numbers rounded.

    Args:
        sections: As of an `EffectiveModel`.
    """
    total = hashlib.sha256()
    for section, elements in sections:
        total.update(_text(section) + _count(elements))
        scale = scales(elements)
        for element, fields in elements:
            total.update(_text(element) + _count(fields))
            for field, values in fields:
                total.update(_text(field) + _count(values))
                total.update(b"".join(map(_value, rounded(values, scale[field]))))
    return total.hexdigest()[:_HEX_DIGITS]


def _value(value: Value) -> bytes:
    """Encode a number as 8 bytes, little-endian, or a word with its length."""
    return b"w" + _text(value) if isinstance(value, str) else b"n" + struct.pack("<d", value)


def _text(text: str) -> bytes:
    """Encode a text after its length, so that no two sequences of texts have the same bytes."""
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


def _count(items: tuple[object, ...]) -> bytes:
    """Encode the number of items that follow."""
    return struct.pack("<I", len(items))
