"""The part of an effective model outside its rigid bodies: options, sizes, flexes, constants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.bodies import digest
from shapechanger.morphology.effective.elements import Rows, Section, Value, word

if TYPE_CHECKING:
    from shapechanger.morphology.effective.elements import Names

_DISABLE: Final = mujoco.mjtDisableBit
_ENABLE: Final = mujoco.mjtEnableBit

# Switches that decide what is computed beside the motion, or that contacts and limits of the
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
_DERIVED_BODY: Final = ("body_subtreemass", "body_invweight0")
_DERIVED: Final = (
    "dof_invweight0",
    "dof_M0",
    "tendon_length0",
    "tendon_invweight0",
    "actuator_length0",
    "actuator_acc0",
)


def options(model: mujoco.MjModel) -> Section:
    """Return timestep, gravity, medium and solver options."""
    option = model.opt
    rows = Rows(("simulation",))
    for name in _NUMBERS:
        rows.numbers(name.replace("_", " "), getattr(option, name))
    if option.density > 0.0 or option.viscosity > 0.0:
        rows.numbers("wind", option.wind)
    if option.enableflags & _ENABLE.mjENBL_SLEEP:
        rows.numbers("sleep tolerance", option.sleep_tolerance)
    rows.words("integrator", [word(mujoco.mjtIntegrator(option.integrator))])
    rows.words("cone", [word(mujoco.mjtCone(option.cone))])
    rows.words("jacobian", [word(mujoco.mjtJacobian(option.jacobian))])
    rows.words("solver", [word(mujoco.mjtSolver(option.solver))])
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


def sizes(model: mujoco.MjModel) -> Section:
    """Return the sizes of position, velocity, control and activation."""
    rows = Rows(_SIZES)
    rows.numbers("dimensions", [getattr(model, name) for name in _SIZES])
    return rows.section(in_order=True)


def flexes(model: mujoco.MjModel, names: Names) -> Section:
    """Return the soft bodies, with their own contact parameters rather than the combined ones.

    Args:
        model: The model.
        names: Names of its elements.
    """
    rows = Rows(names.flexes)
    for name in _FLEX_FIELDS:
        rows.numbers(name, getattr(model, f"flex_{name}"))
    if not model.nflex:
        return ()
    shape: tuple[Value, ...] = (digest(*(getattr(model, name) for name in _FLEX_ARRAYS)),)
    return (*rows.section(), ("all flexes", (("shape", shape),)))


def plugins(model: mujoco.MjModel) -> Section:
    """The engine plugins that the model uses, by a digest of what they were given."""
    if not model.nplugin:
        return ()
    used = digest(
        model.plugin,
        np.frombuffer(bytes(model.plugin_attr), np.uint8),
        model.body_plugin,
        model.geom_plugin,
        model.actuator_plugin,
    )
    return (("all plugins", (("configuration", (used,)),)),)


def derived(model: mujoco.MjModel, kept: NDArray[np.bool_], geoms: NDArray[np.bool_]) -> Section:
    """Return the constants of `mujoco.mj_setConst` that the solver relies on.

    Args:
        model: The compiled model.
        kept: Bodies that matter, shape (nbody,).
        geoms: Geoms that matter, shape (ngeom,).
    """
    moving = kept & (model.body_treeid >= 0)
    arrays = {name: getattr(model, name)[moving] for name in _DERIVED_BODY}
    arrays |= {name: getattr(model, name) for name in _DERIVED}
    arrays["body_margin"] = model.body_margin[kept]
    arrays["geom_rbound"] = model.geom_rbound[geoms]
    arrays["meaninertia"] = np.asarray([model.stat.meaninertia])
    return tuple(
        (name, (("values", tuple((values + 0.0).ravel().tolist())),))
        for name, values in arrays.items()
    )
