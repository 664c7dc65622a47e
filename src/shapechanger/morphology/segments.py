"""The geometry of a body segment: where it is held, where it ends, how it grows.

A segment is held at its joint's anchor (the body's origin where it has no joint) and grows from
there: the anchor stays, everything beyond moves outwards.
"""

from __future__ import annotations

import math
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MorphologyError
from shapechanger.morphology.elements import subtree

__all__ = [
    "anchor",
    "far_end",
    "fromto",
    "require_geometry",
    "resize_limb",
    "rotation",
    "scale_mass",
    "stretch_segment",
    "thicken_segment",
    "volume",
]

_Array = NDArray[np.float64]
_G = mujoco.mjtGeom
_LONG: Final = (_G.mjGEOM_CAPSULE, _G.mjGEOM_CYLINDER)
_AXES: Final = {"x": 0, "y": 1, "z": 2}
# How far a geom may lean from an axis and still count as lying along it: the pole of the inverted
# pendulum leans by 1 mm on 600.
_ALONG: Final = 0.999


def rotation(quaternion: _Array) -> _Array:
    """The rotation matrix, shape (3, 3), of a quaternion (w, x, y, z)."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def orientation(spec: mujoco.MjSpec, element: mujoco.MjsBody | mujoco.MjsGeom) -> _Array:
    """The element's quaternion (w, x, y, z), whichever way its orientation was written."""
    if element.alt.type == mujoco.mjtOrientation.mjORIENTATION_QUAT:
        quaternion = np.array(element.quat, dtype=np.float64)
        return quaternion / np.linalg.norm(quaternion)
    return np.array(
        spec.resolve_orientation(
            degree=bool(spec.compiler.degree),
            sequence=spec.compiler.eulerseq,
            orientation=element.alt,
        )
    )


def anchor(body: mujoco.MjsBody) -> _Array:
    """Where the segment is held, in its own frame, m."""
    return np.array(body.joints[0].pos) if body.joints else np.zeros(3)


def fromto(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> tuple[_Array, _Array] | None:
    """Both ends of a capsule's or cylinder's axis in the body's frame, m; None for other shapes."""
    if geom.type not in _LONG:
        return None
    if not math.isnan(geom.fromto[0]):
        return np.array(geom.fromto[:3]), np.array(geom.fromto[3:])
    half = rotation(orientation(spec, geom))[:, 2] * geom.size[1]
    return geom.pos - half, geom.pos + half


def far_end(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> _Array:
    """The point of the segment's axis farthest from its anchor, in the body's frame, m.

    Raises:
        MorphologyError: If the body has no capsule or cylinder.
    """
    held = anchor(body)
    ends = [end for geom in body.geoms for end in fromto(spec, geom) or ()]
    if not ends:
        raise MorphologyError(
            f"{body.name!r} has no capsule or cylinder, so it has no far end to build on."
        )
    return max(ends, key=lambda end: float(np.linalg.norm(end - held)))


def require_geometry(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> None:
    """Refuse a body whose mass does not follow from its geoms, or whose geoms are meshes.

    Raises:
        MorphologyError: If so: an edit of its shape would leave mass and inertia behind.
    """
    from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if body.explicitinertial and not from_geoms:
        raise MorphologyError(
            f"{body.name!r} has its inertia written out, so a new shape would leave it behind: "
            "remove its <inertial> or set inertiafromgeom."
        )
    for geom in body.geoms:
        if geom.type in (_G.mjGEOM_MESH, _G.mjGEOM_HFIELD, _G.mjGEOM_SDF):
            raise MorphologyError(
                f"{body.name!r} holds {geom.name!r}, a mesh; only spheres, capsules, cylinders, "
                "boxes and ellipsoids can be reshaped."
            )


def volume(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> float:
    """The volume of a primitive geom, m³."""
    a, b, c = (float(x) for x in geom.size)
    match geom.type:
        case _G.mjGEOM_SPHERE:
            return 4.0 / 3.0 * math.pi * a**3
        case _G.mjGEOM_ELLIPSOID:
            return 4.0 / 3.0 * math.pi * a * b * c
        case _G.mjGEOM_BOX:
            return 8.0 * a * b * c
        case _:
            ends = fromto(spec, geom)
            length = float(np.linalg.norm(ends[1] - ends[0])) if ends else 0.0
            caps = 4.0 / 3.0 * math.pi * a**3 if geom.type == _G.mjGEOM_CAPSULE else 0.0
            return math.pi * a**2 * length + caps


def stretch_segment(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    factor: float,
    axis: str | None = None,
    *,
    carry_children: bool = True,
) -> None:
    """Make the segment `factor` times as long, at the same thickness, held at its anchor.

    Args:
        spec: The model that `body` is in.
        body: The segment.
        factor: New length over old length.
        axis: "x", "y" or "z" to stretch along that axis of the body only; None for all three.
        carry_children: Whether what hangs on the segment moves outwards with it.
    """
    scale = np.full(3, factor)
    if axis is not None:
        scale = np.ones(3)
        scale[_AXES[axis]] = factor
    held = anchor(body)

    def outwards(point: _Array) -> _Array:
        return held + scale * (point - held)

    for geom in body.geoms:
        before = volume(spec, geom)
        if not math.isnan(geom.fromto[0]):
            geom.fromto = np.concatenate([outwards(geom.fromto[:3]), outwards(geom.fromto[3:])])
        else:
            _lengthen(spec, geom, factor, axis)
            geom.pos = outwards(geom.pos)
        _keep_density(spec, geom, before)
    for site in body.sites:
        site.pos = outwards(site.pos)
    if carry_children:
        for child in body.bodies:
            offset = rotation(orientation(spec, child)) @ anchor(child)
            child.pos = outwards(child.pos + offset) - offset


def thicken_segment(spec: mujoco.MjSpec, body: mujoco.MjsBody, factor: float) -> None:
    """Make every geom of the body `factor` times as thick, at the same length."""
    for geom in body.geoms:
        before = volume(spec, geom)
        size = np.array(geom.size)
        if geom.type in (*_LONG, _G.mjGEOM_SPHERE):
            size[0] *= factor
        else:
            size[np.arange(3) != np.argmax(size)] *= factor
        geom.size = size
        _keep_density(spec, geom, before)


def resize_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, factor: float) -> None:
    """Make a limb and all that hangs on it `factor` times as large and as strong, in place."""
    joints: set[str] = set()
    for body in subtree(limb):
        stretch_segment(spec, body, factor)
        for geom in body.geoms:
            before = volume(spec, geom)
            size = np.array(geom.size)
            # Stretching has dealt with lengths but for those that a sphere or a thickness is.
            size[_thickness(geom)] *= factor
            geom.size = size
            _keep_density(spec, geom, before)
        for joint in body.joints:
            joints.add(joint.name)
            joint.armature *= factor
            joint.damping = joint.damping * factor
            joint.stiffness = joint.stiffness * factor
    for actuator in spec.actuators:
        if actuator.target in joints:
            actuator.gear = actuator.gear * factor


def _thickness(geom: mujoco.MjsGeom) -> list[int]:
    """The places of a geom's size that stretching leaves alone."""
    if geom.type in (*_LONG, _G.mjGEOM_SPHERE):
        return [0]
    longest = int(np.argmax(geom.size))
    return [i for i in range(3) if i != longest]


def _lengthen(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, factor: float, axis: str | None) -> None:
    """Scale the long half-size of a geom that is given by position and size."""
    if geom.type == _G.mjGEOM_SPHERE:
        return  # A sphere has a place along the segment, and a thickness, but no length.
    size = np.array(geom.size)
    long = 1 if geom.type in _LONG else int(np.argmax(size))
    direction = 2 if geom.type in _LONG else long
    if axis is not None:
        lean = abs(rotation(orientation(spec, geom))[_AXES[axis], direction])
        if lean < 1.0 - _ALONG:
            return
        if lean < _ALONG:
            raise MorphologyError(
                f"{geom.name!r} lies across the axis {axis!r}: stretch it along all axes instead."
            )
    size[long] *= factor
    geom.size = size


def _keep_density(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, volume_before: float) -> None:
    """Let a mass that was written out follow the geom's volume, as a density does by itself."""
    if not math.isnan(geom.mass):
        geom.mass *= volume(spec, geom) / volume_before


def scale_mass(body: mujoco.MjsBody, factor: float) -> None:
    """Scale a body's mass and inertia alike, whichever way they are given."""
    if body.explicitinertial:
        body.mass *= factor
        body.inertia = body.inertia * factor
        body.fullinertia = body.fullinertia * factor
    for geom in body.geoms:
        if math.isnan(geom.mass):
            geom.density *= factor
        else:
            geom.mass *= factor
