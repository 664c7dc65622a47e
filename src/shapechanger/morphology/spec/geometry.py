"""Geometry of geoms, segments and joints: pose, size, volume, mass, and how they stretch.

Points are in the frame of the body, shape (3,), m; quaternions are (w, x, y, z).
"""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MorphologyError

Array = NDArray[np.float64]
_G: Final = mujoco.mjtGeom
_J: Final = mujoco.mjtJoint
_L: Final = mujoco.mjtLimited
LONG: Final = (_G.mjGEOM_CAPSULE, _G.mjGEOM_CYLINDER)
UPRIGHT: Final = np.array([1.0, 0.0, 0.0, 0.0])
OPPOSITE: Final = np.array([1.0, -1.0, -1.0, -1.0])
"""Factors that make the quaternion of the opposite turn."""
_QUAT: Final = mujoco.mjtOrientation.mjORIENTATION_QUAT
_RESOLVER: Final = mujoco.MjSpec()  # `resolve_orientation` is a method; any specification serves.
# Range of a hinge without limits, rad. A slide without limits has no range.
_FULL_TURN: Final = (-math.pi, math.pi)
# Cosine above which a geom lies along an axis; the inverted pendulum's pole leans by 1 mm in 600.
_ALONG: Final = 0.999
# Shares of a length that differ by less are equal; rounding must not decide on which side of a
# cut a point lies.
_SAME: Final = 1e-9


def rotation(quaternion: Array) -> Array:
    """Return the rotation matrix, shape (3, 3), of a quaternion."""
    mujoco.mju_quat2Mat(matrix := np.empty(9), quaternion)
    return matrix.reshape(3, 3)


def product(first: Array, second: Array) -> Array:
    """Return the quaternion of a first turn and then a second one in the turned frame."""
    mujoco.mju_mulQuat(result := np.empty(4), first, second)
    return result


def orientation(element: Any, quat: str = "quat", alt: str = "alt") -> Array:
    """Return the unit quaternion of an element, for any notation of its orientation.

    For the orientation of a body's inertia, pass `iquat` and `ialt`.
    """
    quaternion, written = getattr(element, quat), getattr(element, alt)
    if written.type == _QUAT:
        return quaternion / np.linalg.norm(quaternion)
    degree, sequence = bool(element.compiler.degree), element.compiler.eulerseq
    return np.array(_RESOLVER.resolve_orientation(degree, sequence, written))


def set_orientation(element: Any, quaternion: Array) -> None:
    """Set an element's quaternion, and drop any other form of its orientation."""
    element.quat = quaternion
    element.alt.type = _QUAT


def has_ends(element: Any) -> bool:
    """Return whether a geom or site is given by the ends of its axis; even a box can be."""
    shaped = isinstance(element, mujoco.MjsGeom | mujoco.MjsSite)
    return shaped and not math.isnan(element.fromto[0])


def points_of(element: Any) -> Array:
    """Return the middle of an element, shape (1, 3), or the ends that it is given by, (2, 3)."""
    return np.array(element.fromto if has_ends(element) else element.pos).reshape(-1, 3)


def middle_of(element: Any) -> Array:
    """Return the middle of a geom, site, camera or light."""
    return points_of(element).mean(axis=0)


def move_by(element: Any, shift: Array) -> None:
    """Move a geom, site, camera or light within its body."""
    set_points(element, points_of(element) + shift)


def set_points(element: Any, points: Array) -> None:
    """Move an element to other points, as many as `points_of` returns."""
    if has_ends(element):
        element.fromto = points.ravel()
    else:
        element.pos = points[0]


def axis_ends(geom: mujoco.MjsGeom) -> Array:
    """Return both ends of the axis of a capsule or cylinder, (2, 3); none for other shapes."""
    if geom.type not in LONG:
        return np.empty((0, 3))
    if has_ends(geom):
        return points_of(geom)
    half = rotation(orientation(geom))[:, 2] * geom.size[1]
    return np.array([geom.pos - half, geom.pos + half])


def set_ends(geom: mujoco.MjsGeom, ends: Array) -> None:
    """Define a geom by the ends of its axis, shape (2, 3), instead of by a pose."""
    geom.pos = np.zeros(3)
    set_orientation(geom, UPRIGHT)
    geom.fromto = ends.ravel()


def volume(geom: mujoco.MjsGeom) -> float:
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
            ends = axis_ends(geom)
            length = float(np.linalg.norm(ends[1] - ends[0])) if len(ends) else 0.0
            caps = 4.0 / 3.0 * math.pi * a**3 if geom.type == _G.mjGEOM_CAPSULE else 0.0
            return math.pi * a**2 * length + caps


@contextmanager
def same_density(geom: mujoco.MjsGeom) -> Generator[None]:
    """Scale an explicit mass of a geom with its volume when its shape is changed."""
    before = volume(geom)
    yield
    if not math.isnan(geom.mass) and before > 0.0:
        geom.mass *= volume(geom) / before


def scale_geom_mass(geom: mujoco.MjsGeom, factor: float) -> None:
    """Scale a geom's mass, whether it is given as a mass or as a density."""
    field = "density" if math.isnan(geom.mass) else "mass"
    setattr(geom, field, getattr(geom, field) * factor)


def scale_mass(body: mujoco.MjsBody, factor: float) -> None:
    """Scale a body's mass and inertia, in any notation."""
    if body.explicitinertial:
        body.mass *= factor
        body.inertia *= factor
        body.fullinertia *= factor
    for geom in body.geoms:
        scale_geom_mass(geom, factor)


def resize_geom(geom: mujoco.MjsGeom, held: Array, factor: float) -> None:
    """Scale a geom in every direction about the point `held`."""
    with same_density(geom):
        geom.size *= factor
        move_outwards(geom, held, factor)


def anchor(body: mujoco.MjsBody) -> Array:
    """Return the anchor of a segment: where its first hinge or ball holds it, or its origin."""
    turning = (_J.mjJNT_HINGE, _J.mjJNT_BALL)
    return next((np.array(j.pos) for j in body.joints if j.type in turning), np.zeros(3))


def held_at(body: mujoco.MjsBody) -> Array:
    """Return the anchor of a segment in its parent's frame, m."""
    return body.pos + rotation(orientation(body)) @ anchor(body)


def far_end(body: mujoco.MjsBody) -> Array:
    """Return the end of a capsule or cylinder that is farthest from a segment's anchor."""
    held = anchor(body)
    ends = [end for geom in body.geoms for end in axis_ends(geom)]
    if not ends:
        raise MorphologyError(f"{body.name!r} has no capsule or cylinder, so it has no far end.")
    return max(ends, key=lambda end: float(np.linalg.norm(end - held)))


def inertia_is_written_out(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> bool:
    """Return whether a body states mass and inertia instead of deriving them from its geoms."""
    from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return bool(body.explicitinertial) and not from_geoms


def require_geometry(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> None:
    """Refuse a body with a written inertia, a mesh, height field or SDF; it cannot be reshaped."""
    if inertia_is_written_out(spec, body):
        raise MorphologyError(
            f"{body.name!r} has its inertia written out, so it would not follow a new shape: "
            "remove its <inertial> or set inertiafromgeom."
        )
    for geom in body.geoms:
        if geom.type in (_G.mjGEOM_MESH, _G.mjGEOM_HFIELD, _G.mjGEOM_SDF):
            raise MorphologyError(
                f"{body.name!r} holds {geom.name!r}, a mesh, height field or SDF; only spheres, "
                "capsules, cylinders, boxes and ellipsoids can be reshaped."
            )


def move_outwards(element: Any, held: Array, factor: float | Array) -> None:
    """Move an element, or its ends, as its segment is stretched; the point `held` stays.

    The factor may be an array with one factor for each axis of the body.
    """
    set_points(element, held + factor * (points_of(element) - held))


def lengthen(geom: mujoco.MjsGeom, factor: float, axis: int | None) -> None:
    """Scale the longest half-size of a geom, or the half-size along an axis of the body.

    A geom oblique to the axis is refused; one across it, spheres and geoms with ends are unchanged.
    """
    if geom.type == _G.mjGEOM_SPHERE or has_ends(geom):
        return  # A sphere has no length, and ends are moved by `move_outwards`.
    place, direction = (1, 2) if geom.type in LONG else (int(np.argmax(geom.size)),) * 2
    if axis is not None:
        # Cosines between the axes of the geom and the axis of the body.
        along = np.abs(rotation(orientation(geom))[axis])
        if geom.type not in LONG:
            place = direction = int(np.argmax(along))
        if along[direction] < 1.0 - _ALONG:
            return  # The geom lies across the axis.
        if along[direction] < _ALONG:
            raise MorphologyError(
                f"{geom.name!r} lies oblique to the axis: stretch it along all axes instead."
            )
    geom.size[place] *= factor


def carry_outwards(body: mujoco.MjsBody, held: Array, factor: float | Array) -> None:
    """Move the elements on a stretched segment: joints, sites, cameras, lights and bodies."""
    modes = mujoco.mjtCamLight
    following = (modes.mjCAMLIGHT_TRACK, modes.mjCAMLIGHT_TRACKCOM)
    # Cameras and lights that follow a body do so at a distance.
    mounted = [seen for seen in (*body.cameras, *body.lights) if seen.mode not in following]
    for element in (*body.joints, *body.sites, *mounted):
        move_outwards(element, held, factor)
    for child in body.bodies:
        there = held_at(child)
        child.pos += held + factor * (there - held) - there


def is_limited(element: mujoco.MjsJoint | mujoco.MjsTendon) -> bool:
    """Return whether a joint or tendon has limits."""
    automatic = element.limited == _L.mjLIMITED_AUTO and element.range[0] < element.range[1]
    return automatic or element.limited == _L.mjLIMITED_TRUE


def limits(joint: mujoco.MjsJoint) -> tuple[float, float] | None:
    """Return the range of a hinge or slide, rad or m, and refuse other joints.

    It is a full turn for a hinge without limits, and None for a slide without limits.
    """
    if joint.type not in (_J.mjJNT_HINGE, _J.mjJNT_SLIDE):
        raise MorphologyError(f"{joint.name!r} is neither a hinge nor a slide, so it has no range.")
    if not is_limited(joint):
        return None if joint.type == _J.mjJNT_SLIDE else _FULL_TURN
    lower, upper = np.deg2rad(joint.range) if _in_degrees(joint) else joint.range
    return float(lower), float(upper)


def set_limits(joint: mujoco.MjsJoint, lower: float, upper: float) -> None:
    """Limit the range of a hinge or slide, rad or m."""
    joint.limited = _L.mjLIMITED_TRUE
    joint.range = [as_written(joint, position) for position in (lower, upper)]


def reference_of(joint: mujoco.MjsJoint) -> float:
    """Return the position of a hinge or slide in the model's own pose, rad or m."""
    return math.radians(joint.ref) if _in_degrees(joint) else float(joint.ref)


def _in_degrees(joint: mujoco.MjsJoint) -> bool:
    return bool(joint.compiler.degree) and joint.type == _J.mjJNT_HINGE


def as_written(joint: mujoco.MjsJoint, position: float) -> float:
    """Return a position, rad or m, in the unit of the model.

    If possible, the degrees are those that MuJoCo converts to exactly this angle, such as 30° and
    not 29.999999999999996°.
    """
    if not _in_degrees(joint):
        return position
    near = math.degrees(position)
    candidates = (round(near, 9), near, math.nextafter(near, 0.0), math.nextafter(near, 2.0 * near))
    return next((degrees for degrees in candidates if math.radians(degrees) == position), near)


def displace(joint: mujoco.MjsJoint, by: float | Array) -> None:
    """Move a joint's body as if the joint had moved, by rad, m, or for a ball by a quaternion."""
    body, quaternion = joint.parent, UPRIGHT.copy()
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    if joint.type == _J.mjJNT_BALL:
        quaternion = np.array(by)
    elif joint.type == _J.mjJNT_HINGE:
        mujoco.mju_axisAngle2Quat(quaternion, axis, float(by))
    turn = rotation(quaternion)
    shift = axis * by if joint.type == _J.mjJNT_SLIDE else joint.pos - turn @ joint.pos
    # The body's joints act in order; those before this one are now seen from the turned frame.
    for earlier in body.joints[: [j.name for j in body.joints].index(joint.name)]:
        earlier.axis = turn.T @ earlier.axis
        earlier.pos = turn.T @ (earlier.pos - shift)
    parent = orientation(body)
    body.pos = body.pos + rotation(parent) @ shift
    set_orientation(body, product(parent, quaternion))


class NearPart(NamedTuple):
    """The part of a geom that lies on the near side of a plane."""

    near: Array  # End of its axis on that side, in the body's frame, m.
    share: float  # Share of its length: 1 for the whole geom, 0 for none of it.
    axis: int  # Index of the half-size that is its length.


class Plane:
    """A plane across a segment, at a share of the segment's length from its anchor.

    Attributes:
        along: From the anchor of the segment to its far end, in the body's frame, shape (3,), m.
        place: Where it crosses the axis of the segment, in the body's frame, shape (3,), m.
        children: Bodies that are attached farther out than the plane.
        points: Sites, cameras and lights of the segment farther out.
    """

    def __init__(self, body: mujoco.MjsBody, part: float) -> None:
        self._part, self._held = part, anchor(body)
        self.along = far_end(body) - self._held
        self.place = self._held + part * self.along
        points = (*body.sites, *body.cameras, *body.lights)
        self.children = [child for child in body.bodies if self._is_beyond(held_at(child))]
        self.points = [point for point in points if self._is_beyond(middle_of(point))]

    def _share(self, point: Array) -> float:
        return float((point - self._held) @ self.along) / float(self.along @ self.along)

    def _is_beyond(self, point: Array) -> bool:
        return self._share(point) > self._part + _SAME

    def is_at_end(self, point: Any) -> bool:
        """Return whether a point of the segment is at its far end or past it."""
        return self._share(middle_of(point)) > 1.0 - _SAME

    def piece_of(self, geom: mujoco.MjsGeom) -> NearPart:
        """Return the part of a geom on the near side: all or none of a geom without a length."""
        ends, axis = self._ends(geom)
        if not len(ends):
            middle = middle_of(geom)
            return NearPart(middle, float(not self._is_beyond(middle)), axis)
        near, far = sorted(ends, key=self._share)
        inner, outer = self._share(near), self._share(far)
        if outer <= self._part + _SAME or inner >= self._part - _SAME:
            return NearPart(near, float(outer <= self._part + _SAME), axis)
        # Avoid rounding for a geom that spans the segment.
        if np.allclose(near, self._held, 0.0, _SAME):
            near, inner = self._held, 0.0
        outer = 1.0 if abs(outer - 1.0) < _SAME else outer
        return NearPart(near, (self._part - inner) / (outer - inner), axis)

    def _ends(self, geom: mujoco.MjsGeom) -> tuple[Array, int]:
        """Return both ends of a geom along the segment, and the index of that half-size."""
        if geom.type != _G.mjGEOM_BOX:
            return axis_ends(geom), 1
        if has_ends(geom):
            return points_of(geom), 2
        axes, length = rotation(orientation(geom)), float(np.linalg.norm(self.along))
        along = np.abs(self.along @ axes) / length
        axis = int(np.argmax(along))
        if along[axis] >= _ALONG:
            half = axes[:, axis] * geom.size[axis]
            return np.array([geom.pos - half, geom.pos + half]), axis
        middle, reach = self._share(geom.pos), float(along @ geom.size) / length
        if middle - reach <= self._part + _SAME < middle + reach:
            raise MorphologyError(
                f"{geom.name!r} lies oblique to the plane that would cut it in two: cut "
                f"{geom.parent.name!r} elsewhere."
            )
        return np.empty((0, 3)), axis


def shorten(geom: mujoco.MjsGeom, piece: NearPart, share: float) -> None:
    """Shorten a geom to a share of its length, at its density; the piece's near end stays."""
    with same_density(geom):
        if not has_ends(geom):
            geom.size[piece.axis] *= share
        move_outwards(geom, piece.near, share)
