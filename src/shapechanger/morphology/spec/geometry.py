"""Geometry of geoms and segments: pose, size, volume, mass, and how they stretch.

Points are in the frame of the body, shape (3,), m; quaternions are (w, x, y, z).
"""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.references import key_of, release_drawings

Array = NDArray[np.float64]
Point = mujoco.MjsGeom | mujoco.MjsSite | mujoco.MjsCamera | mujoco.MjsLight
_G: Final = mujoco.mjtGeom
LONG: Final = (_G.mjGEOM_CAPSULE, _G.mjGEOM_CYLINDER)
UPRIGHT: Final = np.array([1.0, 0.0, 0.0, 0.0])
_AXES: Final = {"x": 0, "y": 1, "z": 2}
_TURNING: Final = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_BALL)
# Cosine above which a geom lies along an axis; the pole of the inverted pendulum leans by 1 mm on
# 600.
ALONG: Final = 0.999


# --- Turns -------------------------------------------------------------------------------------


def rotation(quaternion: Array) -> Array:
    """Return the rotation matrix, shape (3, 3), of a quaternion."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def product(first: Array, second: Array) -> Array:
    """Return the quaternion of a second turn, made in the frame that the first has turned."""
    result = np.empty(4)
    mujoco.mju_mulQuat(result, first, second)
    return result


def inverse(quaternion: Array) -> Array:
    """Return the quaternion of the opposite turn."""
    result = np.empty(4)
    mujoco.mju_negQuat(result, quaternion)
    return result


def orientation(spec: mujoco.MjSpec, element: Any, *, of_inertia: bool = False) -> Array:
    """Return the quaternion of an element, or of a body's inertia, however it was written."""
    written, quaternion = element.alt, element.quat
    if of_inertia:
        written, quaternion = element.ialt, element.iquat
    if written.type == mujoco.mjtOrientation.mjORIENTATION_QUAT:
        given = np.array(quaternion, dtype=np.float64)
        return given / np.linalg.norm(given)
    compiler = element.compiler
    return np.array(
        spec.resolve_orientation(
            degree=bool(compiler.degree), sequence=compiler.eulerseq, orientation=written
        )
    )


def set_orientation(element: Any, quaternion: Array) -> None:
    """Set an element's quaternion, and drop any other form of its orientation."""
    element.quat = quaternion
    element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


# --- Geoms and points --------------------------------------------------------------------------


def has_ends(element: Any) -> bool:
    """Return whether a geom or site is given by the ends of its axis; even a box can be."""
    shaped = isinstance(element, mujoco.MjsGeom | mujoco.MjsSite)
    return shaped and not math.isnan(element.fromto[0])


def axis_ends(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> tuple[Array, Array] | None:
    """Return both ends of the axis of a capsule or cylinder; None for other shapes."""
    if geom.type not in LONG:
        return None
    if has_ends(geom):
        return np.array(geom.fromto[:3]), np.array(geom.fromto[3:])
    half = rotation(orientation(spec, geom))[:, 2] * geom.size[1]
    return geom.pos - half, geom.pos + half


def set_ends(geom: mujoco.MjsGeom, ends: Array) -> None:
    """Give a geom by the ends of its axis, shape (2, 3); MuJoCo takes these or a pose."""
    geom.pos = np.zeros(3)
    set_orientation(geom, UPRIGHT)
    geom.fromto = ends.ravel()


def place_of(element: Any) -> Array:
    """Return the middle of a geom, site, camera or light."""
    if has_ends(element):
        return np.array(element.fromto.reshape(2, 3).mean(axis=0))
    return np.array(element.pos)


def move_by(element: Any, shift: Array) -> None:
    """Move a geom, site, camera or light within its body."""
    if has_ends(element):
        element.fromto = element.fromto + np.tile(shift, 2)
    else:
        element.pos = element.pos + shift


def volume(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> float:
    """Return the volume of a primitive geom, m³."""
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


@contextmanager
def same_density(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> Generator[None]:
    """Scale a mass that is written out with the volume of a geom whose shape is changed."""
    before = volume(spec, geom)
    yield
    if not math.isnan(geom.mass) and before > 0.0:
        geom.mass *= volume(spec, geom) / before


def scale_geom_mass(geom: mujoco.MjsGeom, factor: float) -> None:
    """Scale a geom's mass, whether it is given as a mass or as a density."""
    if math.isnan(geom.mass):
        geom.density *= factor
    else:
        geom.mass *= factor


def scale_mass(body: mujoco.MjsBody, factor: float) -> None:
    """Scale a body's mass and inertia, however they are given."""
    if body.explicitinertial:
        body.mass *= factor
        body.inertia = body.inertia * factor
        body.fullinertia = body.fullinertia * factor
    for geom in body.geoms:
        scale_geom_mass(geom, factor)


def stretched(point: Array, held: Array, factor: float, axis: str | None = None) -> Array:
    """Return a point of a segment that is `factor` times as long, along one axis or all three.

    The point `held` stays.
    """
    scale = np.full(3, factor)
    if axis is not None:
        scale = np.ones(3)
        scale[_AXES[axis]] = factor
    return held + scale * (point - held)


def _move_outwards(element: Any, held: Array, factor: float, axis: str | None = None) -> None:
    """Move an element, or its ends, as its segment is stretched."""
    if has_ends(element):
        ends = [stretched(end, held, factor, axis) for end in element.fromto.reshape(2, 3)]
        element.fromto = np.concatenate(ends)
    else:
        element.pos = stretched(element.pos, held, factor, axis)


def resize_geom(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, held: Array, factor: float) -> None:
    """Scale a geom in every direction about the point `held`."""
    with same_density(spec, geom):
        geom.size = geom.size * factor
        _move_outwards(geom, held, factor)


def thicken_geom(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, factor: float) -> None:
    """Scale the thickness of a geom: its radius, or its two smaller half-sizes."""
    with same_density(spec, geom):
        size = np.array(geom.size)
        if geom.type in (*LONG, _G.mjGEOM_SPHERE) or has_ends(geom):
            size[0] *= factor
        else:
            size[np.arange(3) != np.argmax(size)] *= factor
        geom.size = size


def _lengthen(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, factor: float, axis: str | None) -> None:
    """Scale the long half-size of a geom that is given by position and size."""
    if geom.type == _G.mjGEOM_SPHERE:
        return  # A sphere has no length.
    size = np.array(geom.size)
    place, direction = (1, 2) if geom.type in LONG else (int(np.argmax(size)),) * 2
    if axis is not None:
        # How much each axis of the geom lies along that of the body.
        along = np.abs(rotation(orientation(spec, geom))[_AXES[axis]])
        if geom.type not in LONG:
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


# --- Segments ----------------------------------------------------------------------------------


def anchor(body: mujoco.MjsBody) -> Array:
    """Return the anchor of a segment: where its first hinge or ball holds it, or its origin."""
    return next((np.array(j.pos) for j in body.joints if j.type in _TURNING), np.zeros(3))


def held_at(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> Array:
    """Return the anchor of a segment in its parent's frame, m."""
    return body.pos + rotation(orientation(spec, body)) @ anchor(body)


def far_end(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> Array:
    """Return the point of a segment's axis farthest from its anchor.

    Raises:
        MorphologyError: If the body has no capsule or cylinder.
    """
    held = anchor(body)
    ends = [end for geom in body.geoms for end in axis_ends(spec, geom) or ()]
    if not ends:
        raise MorphologyError(f"{body.name!r} has no capsule or cylinder, so it has no far end.")
    return max(ends, key=lambda end: float(np.linalg.norm(end - held)))


def inertia_is_written_out(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> bool:
    """Return whether a body states its own mass and inertia instead of using those of its geoms."""
    from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return bool(body.explicitinertial) and not from_geoms


def require_geometry(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> None:
    """Refuse a body whose mass does not follow from its geoms, or that has meshes.

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
    """Make a segment `factor` times as long, at the same thickness, held at its anchor.

    It is stretched along "x", "y" or "z" of its body, or along all three; what is attached to it
    moves outwards with it.

    Raises:
        MorphologyError: If a geom lies oblique to the axis.
    """
    if factor == 1.0:
        return  # Avoid rounding if nothing moves.
    release_drawings(spec, {key_of(body)})
    held = anchor(body)
    for geom in body.geoms:
        with same_density(spec, geom):
            if not has_ends(geom):
                _lengthen(spec, geom, factor, axis)
            _move_outwards(geom, held, factor, axis)
    carry_outwards(spec, body, held, factor, axis)


def carry_outwards(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, held: Array, factor: float, axis: str | None = None
) -> None:
    """Move what is attached to a stretched segment: joints, sites, cameras, lights and bodies."""
    modes = mujoco.mjtCamLight
    following = (modes.mjCAMLIGHT_TRACK, modes.mjCAMLIGHT_TRACKCOM)
    # Cameras and lights that follow a body do so at a distance.
    mounted = [seen for seen in (*body.cameras, *body.lights) if seen.mode not in following]
    for element in (*body.joints, *body.sites, *mounted):
        _move_outwards(element, held, factor, axis)
    for child in body.bodies:
        held_there = held_at(spec, child)
        child.pos = child.pos + (stretched(held_there, held, factor, axis) - held_there)
