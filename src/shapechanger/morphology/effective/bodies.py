"""The part of an effective model that is the body: bodies, joints, geoms and sites.

Left out is what decides no motion: masses of what cannot move, sizes of planes (drawn, but infinite
in a collision), geoms that neither touch nor push a fluid nor guide a tendon, and bodies that carry
nothing but those.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.contacts import safe_solref
from shapechanger.morphology.effective.elements import Rows, Section, is_any, named, word

if TYPE_CHECKING:
    from shapechanger.morphology.effective.elements import Names

_Floats = NDArray[np.float64]
_SAME: Final = mujoco.mjtSameFrame
_IDENTITY: Final = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames relative to a body.

    Attributes:
        position: Position in m, shape (n, 3).
        orientation: Unit quaternion, its first nonzero number above 0, shape (n, 4).
    """

    position: _Floats
    orientation: _Floats


def inertial_frames(model: mujoco.MjModel) -> Frames:
    """Centres of mass and principal axes of the bodies."""
    same = model.body_sameframe
    at_body = is_any(same, _SAME.mjSAMEFRAME_BODY)[:, None]
    turned_as_body = is_any(same, _SAME.mjSAMEFRAME_BODY, _SAME.mjSAMEFRAME_BODYROT)[:, None]
    return Frames(
        np.where(at_body, 0.0, model.body_ipos),
        _canonical(np.where(turned_as_body, _IDENTITY, model.body_iquat)),
    )


def geom_frames(model: mujoco.MjModel) -> Frames:
    """Frames of the geoms."""
    return _attached(
        model, model.geom_sameframe, model.geom_bodyid, model.geom_pos, model.geom_quat
    )


def site_frames(model: mujoco.MjModel) -> Frames:
    """Frames of the sites."""
    return _attached(
        model, model.site_sameframe, model.site_bodyid, model.site_pos, model.site_quat
    )


def _canonical(quaternions: _Floats) -> _Floats:
    """Of the two quaternions of each rotation the one whose first number is above 0; (n, 4)."""
    leading = np.argmax(quaternions != 0.0, axis=1)[:, None]
    sign = np.sign(np.take_along_axis(quaternions, leading, axis=1))
    return np.where(sign < 0.0, -quaternions, quaternions)


def _attached(
    model: mujoco.MjModel,
    same: NDArray[np.uint8],
    bodies: NDArray[np.int32],
    position: _Floats,
    orientation: _Floats,
) -> Frames:
    """Frames that may coincide with that of their body or with its inertial frame."""
    inertial = inertial_frames(model)

    def choose(own: _Floats, of_body: _Floats, *, rotation: bool) -> _Floats:
        body, inertia = [_SAME.mjSAMEFRAME_BODY], [_SAME.mjSAMEFRAME_INERTIA]
        if rotation:
            body.append(_SAME.mjSAMEFRAME_BODYROT)
            inertia.append(_SAME.mjSAMEFRAME_INERTIAROT)
        rest = _IDENTITY if rotation else (0.0, 0.0, 0.0)
        chosen = np.where(is_any(same, *inertia)[:, None], of_body[bodies], own)
        return np.where(is_any(same, *body)[:, None], rest, chosen)

    return Frames(
        choose(position, inertial.position, rotation=False),
        _canonical(choose(orientation, inertial.orientation, rotation=True)),
    )


_Bools = NDArray[np.bool_]

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
    inertial = inertial_frames(model)
    rows.numbers("centre of mass", inertial.position, moving)
    rows.numbers("inertia axes", inertial.orientation, moving)
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
    """Bodies that move by themselves, weigh something or carry something, shape (nbody,).

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
    kinds = [word(mujoco.mjtJoint(kind)) for kind in model.jnt_type.tolist()]
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
    kinds = [word(mujoco.mjtGeom(kind)) for kind in model.geom_type.tolist()]
    rows.words("type", kinds)
    rows.words("body", named(names.bodies, model.geom_bodyid))
    frames = geom_frames(model)
    rows.numbers("position", frames.position)
    rows.numbers("orientation", frames.orientation)
    sizes = [
        tuple(size[: _SIZE_COUNT.get(kind, 0)])
        for kind, size in zip(kinds, model.geom_size.tolist(), strict=True)
    ]
    rows.words("size", sizes)
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
    rows.words("body", named(names.bodies, model.site_bodyid))
    frames = site_frames(model)
    rows.numbers("position", frames.position)
    rows.numbers("orientation", frames.orientation)
    return rows.section(relevant)


def in_fluid(model: mujoco.MjModel) -> _Bools:
    """The geoms on which a fluid pushes, shape (ngeom,), by the ellipsoid model."""
    medium = model.opt.density > 0.0 or model.opt.viscosity > 0.0
    return (model.geom_fluid[:, 0] > 0.0) & medium


def digest(*arrays: NDArray[np.generic]) -> str:
    """A short name for the content of arrays: equal for equal content."""
    total = hashlib.sha256()
    for array in arrays:
        little_endian = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
        total.update(f"{little_endian.dtype.str}{little_endian.shape}".encode())
        total.update(little_endian.tobytes())
    return total.hexdigest()[:16]


def _shape(model: mujoco.MjModel, kind: str, data: int) -> str:
    """A digest of the mesh or height field that shapes a geom; empty if none does."""
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
