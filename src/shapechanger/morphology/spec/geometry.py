"""Geometry of geoms and segments: pose, size, volume, and how they stretch."""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import subtree
from shapechanger.morphology.spec.references import (
    elements_of,
    moves_only,
    path_elements,
    references,
    release_drawings,
)
from shapechanger.morphology.spec.strength import scale_strength

Array = NDArray[np.float64]
_Oriented = mujoco.MjsBody | mujoco.MjsGeom | mujoco.MjsSite | mujoco.MjsCamera | mujoco.MjsFrame
Point = mujoco.MjsGeom | mujoco.MjsSite | mujoco.MjsCamera | mujoco.MjsLight
_Extended = mujoco.MjsGeom | mujoco.MjsSite
_G = mujoco.mjtGeom
_LONG: Final = (_G.mjGEOM_CAPSULE, _G.mjGEOM_CYLINDER)
_AXES: Final = {"x": 0, "y": 1, "z": 2}
# Cosine above which a geom lies along an axis; the pole of the inverted pendulum leans by 1 mm on
# 600.
ALONG: Final = 0.999


def rotation(quaternion: Array) -> Array:
    """Return the rotation matrix, shape (3, 3), of a quaternion (w, x, y, z)."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def orientation(
    spec: mujoco.MjSpec,
    element: _Oriented,
    alternative: mujoco.MjsOrientation | None = None,
    quaternion: Array | None = None,
) -> Array:
    """Return an element's quaternion (w, x, y, z), however its orientation was written.

    Args:
        spec: Specification that contains it, which says how angles are written.
        element: A body, geom, site, camera or frame.
        alternative: Another orientation of the element, such as that of its inertia.
        quaternion: The quaternion of that.
    """
    alternative = element.alt if alternative is None else alternative
    if alternative.type == mujoco.mjtOrientation.mjORIENTATION_QUAT:
        given = np.array(element.quat if quaternion is None else quaternion, dtype=np.float64)
        return given / np.linalg.norm(given)
    return np.array(
        spec.resolve_orientation(
            degree=bool(element.compiler.degree),
            sequence=element.compiler.eulerseq,
            orientation=alternative,
        )
    )


def has_ends(element: mujoco.MjsGeom | mujoco.MjsSite) -> bool:
    """Return whether an element is given by the ends of its axis; even a box can be."""
    return not math.isnan(element.fromto[0])


def axis_ends(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> tuple[Array, Array] | None:
    """Return both ends of a capsule's or cylinder's axis in its body's frame, m.

    Args:
        spec: Specification that contains it.
        geom: The geom; the result is None for other shapes.
    """
    if geom.type not in _LONG:
        return None
    if has_ends(geom):
        return np.array(geom.fromto[:3]), np.array(geom.fromto[3:])
    half = rotation(orientation(spec, geom))[:, 2] * geom.size[1]
    return geom.pos - half, geom.pos + half


def place_of(element: Point) -> Array:
    """Return the middle of an element in the body's frame, m."""
    if isinstance(element, _Extended) and has_ends(element):
        return np.array(element.fromto.reshape(2, 3).mean(axis=0))
    return np.array(element.pos)


def move_by(element: Point, shift: Array) -> None:
    """Move an element within its body.

    Args:
        element: The geom, site, camera or light.
        shift: Shift in the body's frame, shape (3,), m.
    """
    if isinstance(element, _Extended) and has_ends(element):
        element.fromto = element.fromto + np.tile(shift, 2)
    else:
        element.pos = element.pos + shift


def volume(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> float:
    """Return the volume of a primitive geom, m³.

    Args:
        spec: Specification that contains it.
        geom: The geom.
    """
    a, b, c = (float(x) for x in geom.size)
    if has_ends(geom):
        b, c = a, 0.5 * float(np.linalg.norm(geom.fromto[3:] - geom.fromto[:3]))
    match geom.type:
        case _G.mjGEOM_SPHERE:
            return 4.0 / 3.0 * math.pi * a**3
        case _G.mjGEOM_ELLIPSOID:
            return 4.0 / 3.0 * math.pi * a * b * c
        case _G.mjGEOM_BOX:
            return 8.0 * a * b * c
        case _:
            ends = axis_ends(spec, geom)
            length = float(np.linalg.norm(ends[1] - ends[0])) if ends else 0.0
            caps = 4.0 / 3.0 * math.pi * a**3 if geom.type == _G.mjGEOM_CAPSULE else 0.0
            return math.pi * a**2 * length + caps


def stretched(point: Array, held: Array, factor: float, axis: str | None = None) -> Array:
    """Return a point of a segment after stretching the segment.

    Args:
        point: Position in the body's frame, shape (3,), m.
        held: The point that stays, shape (3,), m.
        factor: New length over the old one.
        axis: The only direction to stretch, "x", "y" or "z"; None for all.
    """
    scale = np.full(3, factor)
    if axis is not None:
        scale = np.ones(3)
        scale[_AXES[axis]] = factor
    return held + scale * (point - held)


def _move_outwards(
    element: mujoco.MjsGeom | mujoco.MjsSite, held: Array, factor: float, axis: str | None = None
) -> None:
    """Move an element, or its ends, as its segment is stretched."""
    if has_ends(element):
        ends = [stretched(end, held, factor, axis) for end in element.fromto.reshape(2, 3)]
        element.fromto = np.concatenate(ends)
    else:
        element.pos = stretched(element.pos, held, factor, axis)


def stretch_geom(
    spec: mujoco.MjSpec, geom: mujoco.MjsGeom, held: Array, factor: float, axis: str | None = None
) -> None:
    """Make a geom `factor` times as long, at the same thickness, moved outwards by this factor.

    Args:
        spec: The model that `geom` is in.
        geom: The geom.
        held: The point of its body that stays, shape (3,), m.
        factor: New length over old length.
        axis: "x", "y" or "z" to stretch along that axis of the body only; None for all three.

    Raises:
        MorphologyError: If the geom lies oblique to the axis.
    """
    before = volume(spec, geom)
    if not has_ends(geom):
        _lengthen(spec, geom, factor, axis)
    _move_outwards(geom, held, factor, axis)
    keep_density(spec, geom, before)


def resize_geom(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, held: Array, factor: float) -> None:
    """Scale a geom in every direction.

    Args:
        spec: Specification that contains it.
        geom: The geom.
        held: The point of its body that stays, shape (3,), m.
        factor: New size over the old one.
    """
    before = volume(spec, geom)
    geom.size = geom.size * factor
    _move_outwards(geom, held, factor)
    keep_density(spec, geom, before)


def thicken_geom(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, factor: float) -> None:
    """Scale the thickness of a geom: its radius, or its two smaller half-sizes.

    Args:
        spec: Specification that contains it.
        geom: The geom.
        factor: New thickness over the old one.
    """
    before = volume(spec, geom)
    size = np.array(geom.size)
    if geom.type in (*_LONG, _G.mjGEOM_SPHERE) or has_ends(geom):
        size[0] *= factor
    else:
        size[np.arange(3) != np.argmax(size)] *= factor
    geom.size = size
    keep_density(spec, geom, before)


def _lengthen(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, factor: float, axis: str | None) -> None:
    """Scale the long half-size of a geom that is given by position and size."""
    if geom.type == _G.mjGEOM_SPHERE:
        return  # A sphere has no length.
    size = np.array(geom.size)
    place, direction = (1, 2) if geom.type in _LONG else (int(np.argmax(size)),) * 2
    if axis is not None:
        # How much each axis of the geom lies along that of the body.
        along = np.abs(rotation(orientation(spec, geom))[_AXES[axis]])
        if geom.type not in _LONG:
            place = direction = int(np.argmax(along))
        if along[direction] < 1.0 - ALONG:
            return  # It lies across the axis.
        if along[direction] < ALONG:
            raise MorphologyError(
                f"{geom.name!r} lies oblique to the axis {axis!r}: stretch it along all axes "
                "instead."
            )
    size[place] *= factor
    geom.size = size


def keep_density(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, volume_before: float) -> None:
    """Scale a mass that is written out with the geom's volume, to keep the density.

    Args:
        spec: Specification that contains it.
        geom: The geom, changed.
        volume_before: Its volume before the change, m³.
    """
    if not math.isnan(geom.mass) and volume_before > 0.0:
        geom.mass *= volume(spec, geom) / volume_before


def scale_geom_mass(geom: mujoco.MjsGeom, factor: float) -> None:
    """Scale a geom's mass, whether it is given as a mass or as a density.

    Args:
        geom: The geom.
        factor: New mass over the old one.
    """
    if math.isnan(geom.mass):
        geom.density *= factor
    else:
        geom.mass *= factor


_TURNING: Final = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_BALL)


def anchor(body: mujoco.MjsBody) -> Array:
    """Return the anchor of the segment in its own frame, m."""
    return next((np.array(j.pos) for j in body.joints if j.type in _TURNING), np.zeros(3))


def held_at(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> Array:
    """Return the anchor of a segment in its parent's frame, m.

    Args:
        spec: Specification that contains it.
        body: Body of the segment.
    """
    return body.pos + rotation(orientation(spec, body)) @ anchor(body)


def far_end(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> Array:
    """Return the point of a segment's axis farthest from its anchor, in the body's frame, m.

    Args:
        spec: Specification that contains it.
        body: Body of the segment.

    Raises:
        MorphologyError: If the body has no capsule or cylinder.
    """
    held = anchor(body)
    ends = [end for geom in body.geoms for end in axis_ends(spec, geom) or ()]
    if not ends:
        raise MorphologyError(f"{body.name!r} has no capsule or cylinder, so it has no far end.")
    return max(ends, key=lambda end: float(np.linalg.norm(end - held)))


def inertia_is_written_out(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> bool:
    """Return whether a body states its own mass and inertia instead of using those of its geoms.

    Args:
        spec: Specification that contains it.
        body: The body.
    """
    from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return bool(body.explicitinertial) and not from_geoms


def require_geometry(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> None:
    """Refuse a body whose mass does not follow from its geoms, or that has meshes.

    Args:
        spec: Specification that contains it.
        body: The body.

    Raises:
        MorphologyError: If its mass and inertia would not follow a new shape.
    """
    if inertia_is_written_out(spec, body):
        raise MorphologyError(
            f"{body.name!r} has its inertia written out, so it would not follow a new shape: "
            "remove its <inertial> or set inertiafromgeom."
        )
    for geom in body.geoms:
        if geom.type in (_G.mjGEOM_MESH, _G.mjGEOM_HFIELD, _G.mjGEOM_SDF):
            raise MorphologyError(
                f"{body.name!r} holds {geom.name!r}, a mesh; only spheres, capsules, cylinders, "
                "boxes and ellipsoids can be reshaped."
            )


def stretch_segment(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, factor: float, axis: str | None = None
) -> None:
    """Make the segment `factor` times as long, at the same thickness, held at its anchor.

    What is attached to it moves outwards with it.

    Args:
        spec: The model that `body` is in.
        body: The segment.
        factor: New length over old length.
        axis: "x", "y" or "z" to stretch along that axis of the body only; None for all three.
    """
    if factor == 1.0:
        return  # Moving a point by nothing may still round it.
    release_drawings(spec, {(mujoco.mjtObj.mjOBJ_BODY, body.name)})
    held = anchor(body)
    for geom in body.geoms:
        stretch_geom(spec, geom, held, factor, axis)
    _carry_outwards(spec, body, held, factor, axis)


def _carry_outwards(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, held: Array, factor: float, axis: str | None = None
) -> None:
    """Move what is attached to a stretched segment: joints, sites, cameras, lights and bodies."""
    for joint in body.joints:
        joint.pos = stretched(joint.pos, held, factor, axis)
    for site in body.sites:
        _move_outwards(site, held, factor, axis)
    for seen in (*body.cameras, *body.lights):
        if is_mounted(seen):
            seen.pos = stretched(seen.pos, held, factor, axis)
    for child in body.bodies:
        held_there = held_at(spec, child)
        child.pos = child.pos + (stretched(held_there, held, factor, axis) - held_there)


def is_mounted(seen: mujoco.MjsCamera | mujoco.MjsLight) -> bool:
    """Return whether a camera or light is fixed to its body; others follow at a distance."""
    modes = mujoco.mjtCamLight
    return seen.mode not in (modes.mjCAMLIGHT_TRACK, modes.mjCAMLIGHT_TRACKCOM)


def resize_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, factor: float) -> None:
    """Scale a limb in size and strength, in place, with everything attached to it.

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.
        factor: New size over the old one.

    Raises:
        MorphologyError: If a body of it cannot be reshaped, or an actuator cannot be scaled.
    """
    for body in subtree(limb):
        require_geometry(spec, body)
        held = anchor(body)
        for geom in body.geoms:
            resize_geom(spec, geom, held, factor)
        _carry_outwards(spec, body, held, factor)
        for joint in body.joints:
            joint.armature *= factor
            joint.damping = joint.damping * factor
            joint.stiffness = joint.stiffness * factor
            joint.frictionloss *= factor
    elements = elements_of(limb)
    release_drawings(spec, elements)
    for tendon in spec.tendons:
        path = {*path_elements(tendon)}
        if path.isdisjoint(elements) or not moves_only(spec, tendon, elements):
            continue
        elements.add((mujoco.mjtObj.mjOBJ_TENDON, tendon.name))
        tendon.armature *= factor
        tendon.damping = tendon.damping * factor
        tendon.stiffness = tendon.stiffness * factor
        tendon.frictionloss *= factor
        if path <= elements and mujoco.mjtObj.mjOBJ_JOINT not in {kind for kind, _ in path}:
            tendon.range = tendon.range * factor
            # A negative length stands for the length in the reference pose.
            lengths = np.array(tendon.springlength)
            tendon.springlength = np.where(lengths > 0.0, lengths * factor, lengths)
    strong = (mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_TENDON)
    for mention in references(spec, "actuator"):
        if mention.element in elements and mention.element[0] in strong:
            scale_strength(mention.holder, factor)


def scale_mass(body: mujoco.MjsBody, factor: float) -> None:
    """Scale a body's mass and inertia, however they are given.

    Args:
        body: The body.
        factor: New mass over the old one.
    """
    if body.explicitinertial:
        body.mass *= factor
        body.inertia = body.inertia * factor
        body.fullinertia = body.fullinertia * factor
    for geom in body.geoms:
        scale_geom_mass(geom, factor)
