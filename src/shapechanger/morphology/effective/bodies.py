"""The bodies, joints, geoms and sites of an effective model.

Omitted is what decides no motion: masses of what cannot move, sizes of planes (drawn, but infinite
in a collision), geoms that neither touch nor push a fluid nor guide a tendon, and bodies that carry
nothing but those.
"""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING, Final, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.contacts import safe_solref
from shapechanger.morphology.effective.elements import Rows, Section, is_any, named, words

if TYPE_CHECKING:
    from shapechanger.morphology.effective.elements import Names

_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]
_SAME: Final = mujoco.mjtSameFrame
_IDENTITY: Final = (1.0, 0.0, 0.0, 0.0)


def frames(
    model: mujoco.MjModel, kind: Literal["inertia", "geom", "site"]
) -> tuple[_Floats, _Floats]:
    """Return the frames of elements relative to their bodies.

    MuJoCo copies the frame of the body, or that of its inertia, where it found them the same when
    the model was compiled; it then ignores the element's own numbers.

    Args:
        model: The model.
        kind: Geoms, sites, or the inertias of the bodies.

    Returns:
        Positions, m, shape (n, 3), and orientations, shape (n, 4): unit quaternions whose first
        nonzero number is above 0.
    """
    if kind == "inertia":
        same, position, orientation = model.body_sameframe, model.body_ipos, model.body_iquat
    else:
        same = getattr(model, f"{kind}_sameframe")
        owner = getattr(model, f"{kind}_bodyid")
        inertia_position, inertia_orientation = frames(model, "inertia")
        at_inertia = is_any(same, _SAME.mjSAMEFRAME_INERTIA)[:, None]
        turned = is_any(same, _SAME.mjSAMEFRAME_INERTIA, _SAME.mjSAMEFRAME_INERTIAROT)[:, None]
        position = np.where(at_inertia, inertia_position[owner], getattr(model, f"{kind}_pos"))
        orientation = np.where(turned, inertia_orientation[owner], getattr(model, f"{kind}_quat"))
    at_body = is_any(same, _SAME.mjSAMEFRAME_BODY)[:, None]
    turned = is_any(same, _SAME.mjSAMEFRAME_BODY, _SAME.mjSAMEFRAME_BODYROT)[:, None]
    return np.where(at_body, 0.0, position), _canonical(np.where(turned, _IDENTITY, orientation))


def _canonical(quaternions: _Floats) -> _Floats:
    """Return, of the two quaternions of each rotation, that whose first number is above 0."""
    leading = np.argmax(quaternions != 0.0, axis=1)[:, None]
    sign = np.sign(np.take_along_axis(quaternions, leading, axis=1))
    return np.where(sign < 0.0, -quaternions, quaternions)


# Numbers of `qpos` and of `qvel` that a joint takes.
_QPOS_COUNT: Final = {"free": 7, "ball": 4, "slide": 1, "hinge": 1}
_DOF_COUNT: Final = {"free": 6, "ball": 3, "slide": 1, "hinge": 1}

# How many of the three sizes of a geom shape it; meshes and height fields have their own data.
_SIZE_COUNT: Final = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}


def bodies(model: mujoco.MjModel, names: Names, kept: _Bools) -> Section:
    """Return pose, mass and inertia of bodies.

    Args:
        model: The model.
        names: Names of its elements.
        kept: Mask of the bodies to return, shape (nbody,).
    """
    rows = Rows(names.bodies)
    moving = model.body_treeid >= 0
    free = np.zeros(model.nbody, np.bool_)
    free[model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]] = True
    rows.words("parent", named(names.bodies, model.body_parentid))
    rows.numbers("position", model.body_pos, ~free)  # A free body starts from its joint's qpos0.
    rows.numbers("orientation", _canonical(model.body_quat), ~free)
    rows.numbers("mass", model.body_mass, moving)
    rows.numbers("inertia", model.body_inertia, moving)
    centres, axes = frames(model, "inertia")
    rows.numbers("centre of mass", centres, moving)
    rows.numbers("inertia axes", axes, moving)
    # Read only if the compiler, or mj_setConst, found a body that has some.
    rows.numbers("gravity compensation", model.body_gravcomp * model.flg_gravcomp, moving)
    mocap = model.body_mocapid >= 0
    rows.numbers("mocap", mocap, mocap)
    asleep = np.zeros(model.nbody, np.bool_)
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        asleep[model.tree_bodyadr] = True
        policy = np.zeros(model.nbody)
        policy[model.tree_bodyadr] = model.tree_sleep_policy
        rows.numbers("sleep policy", policy, asleep)
    return rows.section(kept)


def bodies_that_matter(model: mujoco.MjModel, carrying: _Bools) -> _Bools:
    """Return the bodies that move by themselves, have mass or carry something, shape (nbody,).

    Args:
        model: The compiled model.
        carrying: Bodies that bear a geom, a site or a constraint that matters, shape (nbody,).
    """
    heavy = (model.body_treeid >= 0) & (model.body_mass > 0.0)
    kept = carrying | heavy | (model.body_mocapid >= 0) | (model.body_jntnum > 0)
    for child in range(model.nbody - 1, 0, -1):  # A child's index is above its parent's.
        kept[model.body_parentid[child]] |= kept[child]
    kept[0] = False  # The world is the same in every model.
    return kept


def joints(model: mujoco.MjModel, names: Names) -> Section:
    """Return type, axis, limits and resistance of the joints; angles in rad.

    Args:
        model: The model.
        names: Names of its elements.
    """
    rows = Rows(names.joints)
    kinds = words(mujoco.mjtJoint, model.jnt_type)
    kind = np.asarray(kinds, np.str_)
    qpos, dof = model.jnt_qposadr.tolist(), model.jnt_dofadr.tolist()
    coordinates, dofs = [_QPOS_COUNT[name] for name in kinds], [_DOF_COUNT[name] for name in kinds]
    rows.words("type", kinds)
    rows.words("body", named(names.bodies, model.jnt_bodyid))
    rows.numbers("anchor", model.jnt_pos, kind != "free")
    rows.numbers("axis", model.jnt_axis, np.isin(kind, ("slide", "hinge")))
    rows.parts("rest position", model.qpos0, qpos, coordinates)
    limited = model.jnt_limited & (kind != "free")
    rows.numbers("joint range", model.jnt_range, limited)
    rows.numbers("limit margin", model.jnt_margin, limited)
    rows.numbers("limit solref", safe_solref(model, model.jnt_solref), limited)
    rows.numbers("limit solimp", model.jnt_solimp, limited)
    springy = (model.jnt_stiffness != 0.0) | model.jnt_stiffnesspoly.any(axis=1)
    rows.numbers("stiffness", model.jnt_stiffness)
    rows.numbers("stiffness polynomial", model.jnt_stiffnesspoly, springy)
    rows.numbers("spring yield", model.jnt_springyield, springy & (model.jnt_plasticadr >= 0))
    counts = [n * has for n, has in zip(coordinates, springy.tolist(), strict=True)]
    rows.parts("spring reference", model.qpos_spring, qpos, counts)
    rows.parts("damping", model.dof_damping, dof, dofs)
    rows.parts("damping polynomial", model.dof_dampingpoly, dof, dofs)
    rows.parts("armature", model.dof_armature, dof, dofs)
    rows.parts("friction loss", model.dof_frictionloss, dof, dofs)
    lossy = (model.dof_frictionloss > 0.0).tolist()
    rubbing = [n * any(lossy[start : start + n]) for start, n in zip(dof, dofs, strict=True)]
    rows.parts("friction solref", safe_solref(model, model.dof_solref), dof, rubbing)
    rows.parts("friction solimp", model.dof_solimp, dof, rubbing)
    rows.numbers("actuator force range", model.jnt_actfrcrange, model.jnt_actfrclimited)
    rows.numbers("gravity compensation by actuators", model.jnt_actgravcomp)
    return rows.section(in_order=True)


def geoms(model: mujoco.MjModel, names: Names, relevant: _Bools) -> Section:
    """Return the shapes that touch, displace a fluid or guide a tendon.

    Args:
        model: The model.
        names: Names of its elements.
        relevant: Mask of these geoms, shape (ngeom,).
    """
    rows = Rows(names.geoms)
    kinds = words(mujoco.mjtGeom, model.geom_type)
    rows.words("type", kinds)
    _place(rows, model, names, "geom")
    rows.numbers("size", model.geom_size, counts=[_SIZE_COUNT.get(kind, 0) for kind in kinds])
    rows.words(
        "shape",
        [
            _shape(model, kind, data) if wanted else ""
            for kind, data, wanted in zip(
                kinds, model.geom_dataid.tolist(), relevant.tolist(), strict=True
            )
        ],
    )
    conveying = (np.count_nonzero(model.geom_surfacevel, axis=1) > 0) & model.flg_surfacevel
    rows.numbers("surface velocity", model.geom_surfacevel, conveying)
    rows.numbers("fluid coefficients", model.geom_fluid, in_fluid(model))
    return rows.section(relevant)


def sites(model: mujoco.MjModel, names: Names, relevant: _Bools) -> Section:
    """Return the points to which tendons, actuators and constraints are attached.

    Args:
        model: The model.
        names: Names of its elements.
        relevant: Mask of these sites, shape (nsite,).
    """
    rows = Rows(names.sites)
    _place(rows, model, names, "site")
    return rows.section(relevant)


def _place(rows: Rows, model: mujoco.MjModel, names: Names, kind: Literal["geom", "site"]) -> None:
    """Set the body of each element, and its frame relative to that."""
    rows.words("body", named(names.bodies, getattr(model, f"{kind}_bodyid")))
    positions, orientations = frames(model, kind)
    rows.numbers("position", positions)
    rows.numbers("orientation", orientations)


def in_fluid(model: mujoco.MjModel) -> _Bools:
    """Return the geoms on which a fluid pushes by the ellipsoid model, shape (ngeom,)."""
    medium = model.opt.density > 0.0 or model.opt.viscosity > 0.0
    return (model.geom_fluid[:, 0] > 0.0) & medium


# Coordinates of a mesh are in single precision, and every machine rounds them in its own way. No
# round number lies half-way between two multiples of this part of the largest.
_GRAIN: Final = 1e-5 / 1.0471975511965976
_ONE: Final = 1.0 - 1e-5  # A number just below a power of ten counts as that power.


def digest(*arrays: NDArray[np.generic]) -> str:
    """Return 16 hex digits that are equal for equal types, shapes and contents of arrays.

    Numbers count up to a hundred-thousandth of the largest of their array.
    """
    total = hashlib.sha256()
    for array in arrays:
        if np.issubdtype(array.dtype, np.floating) and array.size:
            largest = float(np.abs(array).max())
            exponent = math.floor(math.log10(largest / _ONE)) if largest > 0.0 else 0
            total.update(f"{exponent} ".encode())
            grains = array.astype(np.float64) / (_GRAIN * 10.0**exponent)
            array = np.rint(grains).astype(np.int64)
        little_endian = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
        total.update(f"{little_endian.dtype.str}{little_endian.shape}".encode())
        total.update(little_endian.tobytes())
    return total.hexdigest()[:16]


def _shape(model: mujoco.MjModel, kind: str, data: int) -> str:
    """Return a digest of the mesh or height field that shapes a geom; empty if none does."""
    if kind == "hfield":
        start = model.hfield_adr[data]
        count = model.hfield_nrow[data] * model.hfield_ncol[data]
        return digest(
            model.hfield_size[data],
            model.hfield_nrow[data : data + 1],
            model.hfield_data[start : start + count],
        )
    if kind not in ("mesh", "sdf"):
        return ""
    vertex, face = model.mesh_vertadr[data], model.mesh_faceadr[data]
    return digest(
        model.mesh_vert[vertex : vertex + model.mesh_vertnum[data]],
        model.mesh_face[face : face + model.mesh_facenum[data]],
    )
