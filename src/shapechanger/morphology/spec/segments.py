"""The geometry of a body segment: where it is held, where it ends, how it grows.

A segment is held at the anchor of its first hinge or ball joint, or at the body's origin where it
has none: slides and free joints turn about no point. It grows from there: the anchor stays,
everything beyond moves outwards.
"""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import subtree
from shapechanger.morphology.spec.geoms import (
    Array,
    axis_ends,
    move_outwards,
    orientation,
    resize_geom,
    rotation,
    scale_geom_mass,
    stretch_geom,
    stretched,
    thicken_geom,
)

__all__ = [
    "anchor",
    "far_end",
    "held_at",
    "inertia_is_written_out",
    "require_geometry",
    "resize_limb",
    "scale_mass",
    "stretch_segment",
    "thicken_segment",
]

_G = mujoco.mjtGeom
_TURNING: Final = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_BALL)


def anchor(body: mujoco.MjsBody) -> Array:
    """Where the segment is held, in its own frame, m."""
    return next((np.array(j.pos) for j in body.joints if j.type in _TURNING), np.zeros(3))


def held_at(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> Array:
    """Where the segment is held, in its parent's frame, m."""
    return body.pos + rotation(orientation(spec, body)) @ anchor(body)


def far_end(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> Array:
    """The point of the segment's axis farthest from its anchor, in the body's frame, m.

    Raises:
        MorphologyError: If the body has no capsule or cylinder.
    """
    held = anchor(body)
    ends = [end for geom in body.geoms for end in axis_ends(spec, geom) or ()]
    if not ends:
        raise MorphologyError(
            f"{body.name!r} has no capsule or cylinder, so it has no far end to build on."
        )
    return max(ends, key=lambda end: float(np.linalg.norm(end - held)))


def inertia_is_written_out(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> bool:
    """Whether mass and inertia are the body's own numbers instead of those of its geoms."""
    from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return bool(body.explicitinertial) and not from_geoms


def require_geometry(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> None:
    """Refuse a body whose mass does not follow from its geoms, or whose geoms are meshes.

    Raises:
        MorphologyError: If so: an edit of its shape would leave mass and inertia behind.
    """
    if inertia_is_written_out(spec, body):
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


def stretch_segment(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, factor: float, axis: str | None = None
) -> None:
    """Make the segment `factor` times as long, at the same thickness, held at its anchor.

    What hangs on it moves outwards with it.

    Args:
        spec: The model that `body` is in.
        body: The segment.
        factor: New length over old length.
        axis: "x", "y" or "z" to stretch along that axis of the body only; None for all three.
    """
    if factor == 1.0:
        return  # Moving a point by nothing may still round it.
    held = anchor(body)
    for geom in body.geoms:
        stretch_geom(spec, geom, held, factor, axis)
    _carry_outwards(spec, body, held, factor, axis)


def _carry_outwards(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, held: Array, factor: float, axis: str | None = None
) -> None:
    """Move what hangs on a segment that is stretched: further joints, sites, bodies."""
    for joint in body.joints:
        joint.pos = stretched(joint.pos, held, factor, axis)
    for site in body.sites:
        move_outwards(site, held, factor, axis)
    for child in body.bodies:
        held_there = held_at(spec, child)
        child.pos = child.pos + (stretched(held_there, held, factor, axis) - held_there)


def thicken_segment(spec: mujoco.MjSpec, body: mujoco.MjsBody, factor: float) -> None:
    """Make every geom of the body `factor` times as thick, at the same length."""
    for geom in body.geoms:
        thicken_geom(spec, geom, factor)


def resize_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, factor: float) -> None:
    """Make a limb and all that hangs on it `factor` times as large and as strong, in place.

    Raises:
        MorphologyError: If a body of it cannot be reshaped.
    """
    joints: set[str] = set()
    for body in subtree(limb):
        require_geometry(spec, body)
        held = anchor(body)
        for geom in body.geoms:
            resize_geom(spec, geom, held, factor)
        _carry_outwards(spec, body, held, factor)
        for joint in body.joints:
            joints.add(joint.name)
            joint.armature *= factor
            joint.damping = joint.damping * factor
            joint.stiffness = joint.stiffness * factor
            joint.frictionloss *= factor
    for actuator in spec.actuators:
        if actuator.target in joints:
            actuator.gear = actuator.gear * factor


def scale_mass(body: mujoco.MjsBody, factor: float) -> None:
    """Scale a body's mass and inertia alike, whichever way they are given."""
    if body.explicitinertial:
        body.mass *= factor
        body.inertia = body.inertia * factor
        body.fullinertia = body.fullinertia * factor
    for geom in body.geoms:
        scale_geom_mass(geom, factor)
