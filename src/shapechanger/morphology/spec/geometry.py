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
from shapechanger.morphology.spec.references import key_of, release_drawings

Array = NDArray[np.float64]
Point = mujoco.MjsGeom | mujoco.MjsSite | mujoco.MjsCamera | mujoco.MjsLight
_G: Final = mujoco.mjtGeom
_J: Final = mujoco.mjtJoint
LONG: Final = (_G.mjGEOM_CAPSULE, _G.mjGEOM_CYLINDER)
UPRIGHT: Final = np.array([1.0, 0.0, 0.0, 0.0])
_QUAT: Final = mujoco.mjtOrientation.mjORIENTATION_QUAT
# The method needs any specification, even an empty one.
_RESOLVER: Final = mujoco.MjSpec()
_AXES: Final = {"x": 0, "y": 1, "z": 2}
# A joint without limits turns all the way round; a slide without limits has no such number.
_FULL_TURN: Final = (-math.pi, math.pi)
# Cosine above which a geom lies along an axis; the pole of the inverted pendulum leans by 1 mm on
# 600.
_ALONG: Final = 0.999
# Shares of a length that differ by less are the same; rounding must not decide on which side of a
# cut a point lies.
_SAME: Final = 1e-9


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


def orientation(element: Any, quat: str = "quat", alt: str = "alt") -> Array:
    """Return the unit quaternion of an element, for any notation of its orientation.

    That of a body's inertia is in the fields `iquat` and `ialt`.
    """
    quaternion, written = getattr(element, quat), getattr(element, alt)
    if written.type == _QUAT:
        return quaternion / np.linalg.norm(quaternion)
    compiler = element.compiler
    resolved = _RESOLVER.resolve_orientation(
        degree=bool(compiler.degree), sequence=compiler.eulerseq, orientation=written
    )
    return np.array(resolved)


def set_orientation(element: Any, quaternion: Array) -> None:
    """Set an element's quaternion, and drop any other form of its orientation."""
    element.quat = quaternion
    element.alt.type = _QUAT


# --- Geoms and points --------------------------------------------------------------------------


def has_ends(element: Any) -> bool:
    """Return whether a geom or site is given by the ends of its axis; even a box can be."""
    shaped = isinstance(element, mujoco.MjsGeom | mujoco.MjsSite)
    return shaped and not math.isnan(element.fromto[0])


def axis_ends(geom: mujoco.MjsGeom) -> tuple[Array, Array] | None:
    """Return both ends of the axis of a capsule or cylinder; None for other shapes."""
    if geom.type not in LONG:
        return None
    if has_ends(geom):
        return np.array(geom.fromto[:3]), np.array(geom.fromto[3:])
    half = rotation(orientation(geom))[:, 2] * geom.size[1]
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
            length = float(np.linalg.norm(ends[1] - ends[0])) if ends else 0.0
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
        body.inertia = body.inertia * factor
        body.fullinertia = body.fullinertia * factor
    for geom in body.geoms:
        scale_geom_mass(geom, factor)


def resize_geom(geom: mujoco.MjsGeom, held: Array, factor: float) -> None:
    """Scale a geom in every direction about the point `held`."""
    with same_density(geom):
        geom.size = geom.size * factor
        _move_outwards(geom, held, factor)


# --- Segments ----------------------------------------------------------------------------------


def anchor(body: mujoco.MjsBody) -> Array:
    """Return the anchor of a segment: where its first hinge or ball holds it, or its origin."""
    turning = (_J.mjJNT_HINGE, _J.mjJNT_BALL)
    return next((np.array(j.pos) for j in body.joints if j.type in turning), np.zeros(3))


def held_at(body: mujoco.MjsBody) -> Array:
    """Return the anchor of a segment in its parent's frame, m."""
    return body.pos + rotation(orientation(body)) @ anchor(body)


def far_end(body: mujoco.MjsBody) -> Array:
    """Return the point of a segment's axis farthest from its anchor; refuse one without an axis."""
    held = anchor(body)
    ends = [end for geom in body.geoms for end in axis_ends(geom) or ()]
    if not ends:
        raise MorphologyError(f"{body.name!r} has no capsule or cylinder, so it has no far end.")
    return max(ends, key=lambda end: float(np.linalg.norm(end - held)))


def inertia_is_written_out(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> bool:
    """Return whether a body states mass and inertia instead of deriving them from its geoms."""
    from_geoms = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return bool(body.explicitinertial) and not from_geoms


def require_geometry(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> None:
    """Refuse a body with mass and inertia that do not depend on the shapes of its geoms."""
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


def stretched(point: Array, held: Array, factor: float, axis: str | None = None) -> Array:
    """Return a point of a segment that is `factor` times as long; the point `held` stays."""
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


def stretch_segment(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, factor: float, axis: str | None = None
) -> None:
    """Make a segment `factor` times as long, at the same thickness, held at its anchor.

    It is stretched along "x", "y" or "z" of its body, or along all three; what is attached to it
    moves outwards with it. A geom that lies oblique to the axis is refused.
    """
    if factor == 1.0:
        return  # Avoid rounding if nothing moves.
    release_drawings(spec, {key_of(body)})
    held = anchor(body)
    for geom in body.geoms:
        with same_density(geom):
            if not has_ends(geom):
                _lengthen(geom, factor, axis)
            _move_outwards(geom, held, factor, axis)
    carry_outwards(body, held, factor, axis)


def _lengthen(geom: mujoco.MjsGeom, factor: float, axis: str | None) -> None:
    """Scale the long half-size of a geom that is given by position and size."""
    if geom.type == _G.mjGEOM_SPHERE:
        return  # A sphere has no length.
    size = np.array(geom.size)
    place, direction = (1, 2) if geom.type in LONG else (int(np.argmax(size)),) * 2
    if axis is not None:
        # How much each axis of the geom lies along that of the body.
        along = np.abs(rotation(orientation(geom))[_AXES[axis]])
        if geom.type not in LONG:
            place = direction = int(np.argmax(along))
        if along[direction] < 1.0 - _ALONG:
            return  # It lies across the axis.
        if along[direction] < _ALONG:
            raise MorphologyError(
                f"{geom.name!r} lies oblique to the axis {axis!r}: stretch it along all axes "
                "instead."
            )
    size[place] *= factor
    geom.size = size


def carry_outwards(
    body: mujoco.MjsBody, held: Array, factor: float, axis: str | None = None
) -> None:
    """Move the elements on a stretched segment: joints, sites, cameras, lights and bodies."""
    modes = mujoco.mjtCamLight
    following = (modes.mjCAMLIGHT_TRACK, modes.mjCAMLIGHT_TRACKCOM)
    # Cameras and lights that follow a body do so at a distance.
    mounted = [seen for seen in (*body.cameras, *body.lights) if seen.mode not in following]
    for element in (*body.joints, *body.sites, *mounted):
        _move_outwards(element, held, factor, axis)
    for child in body.bodies:
        held_there = held_at(child)
        child.pos = child.pos + (stretched(held_there, held, factor, axis) - held_there)


# --- Joints ------------------------------------------------------------------------------------


def limits(joint: mujoco.MjsJoint) -> tuple[float, float] | None:
    """Return the range of a hinge or slide, rad or m, and refuse other joints.

    It is a full turn for a hinge without limits, None for a slide without.
    """
    if joint.type not in (_J.mjJNT_HINGE, _J.mjJNT_SLIDE):
        raise MorphologyError(f"{joint.name!r} is neither a hinge nor a slide, so it has no range.")
    lower, upper = (float(x) for x in joint.range)
    automatic = joint.limited == mujoco.mjtLimited.mjLIMITED_AUTO and lower < upper
    if joint.limited != mujoco.mjtLimited.mjLIMITED_TRUE and not automatic:
        return None if joint.type == _J.mjJNT_SLIDE else _FULL_TURN
    if _in_degrees(joint):
        return math.radians(lower), math.radians(upper)
    return lower, upper


def set_limits(joint: mujoco.MjsJoint, lower: float, upper: float) -> None:
    """Limit the range of a hinge or slide, rad or m."""
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    joint.range = [_as_written(joint, lower), _as_written(joint, upper)]


def reference_of(joint: mujoco.MjsJoint) -> float:
    """Return the position of a hinge or slide in the model's own pose, rad or m."""
    return math.radians(joint.ref) if _in_degrees(joint) else float(joint.ref)


def set_reference(joint: mujoco.MjsJoint, position: float) -> None:
    """Set the position of a hinge or slide in the model's own pose, rad or m; the pose stays."""
    joint.ref = _as_written(joint, position)


def _in_degrees(joint: mujoco.MjsJoint) -> bool:
    return bool(joint.compiler.degree) and joint.type == _J.mjJNT_HINGE


def _as_written(joint: mujoco.MjsJoint, position: float) -> float:
    """Return a position, rad or m, in the unit of the model.

    MuJoCo converts degrees to exactly this angle if possible, as for every angle that was written
    in degrees: 30° is not 29.999999999999996°.
    """
    if not _in_degrees(joint):
        return position
    near = math.degrees(position)
    candidates = (round(near, 9), near, math.nextafter(near, 0.0), math.nextafter(near, 2.0 * near))
    return next((degrees for degrees in candidates if math.radians(degrees) == position), near)


def displace(joint: mujoco.MjsJoint, by: float | Array) -> None:
    """Change the pose of a joint's body as if the joint had moved by an angle, rad, or a distance.

    For a ball joint it is the turn as a quaternion (w, x, y, z).
    """
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


# --- Cuts --------------------------------------------------------------------------------------


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
    """

    def __init__(self, body: mujoco.MjsBody, part: float) -> None:
        self._body, self._part = body, part
        self._held = anchor(body)
        self.along = far_end(body) - self._held
        self.place = self._held + part * self.along

    def _share(self, point: Array) -> float:
        """Return the position of a point along the segment as a share of its length."""
        return float((point - self._held) @ self.along) / float(self.along @ self.along)

    def _is_beyond(self, point: Array) -> bool:
        return self._share(point) > self._part + _SAME

    def is_at_end(self, point: Point) -> bool:
        """Return whether a point of the segment is at its far end or past it."""
        return self._share(place_of(point)) > 1.0 - _SAME

    def children_beyond(self) -> list[mujoco.MjsBody]:
        """Return the bodies that are attached farther out than the plane."""
        return [c for c in self._body.bodies if self._is_beyond(held_at(c))]

    def points_beyond(self) -> list[Point]:
        """Return the sites, cameras and lights of the segment farther out than the plane."""
        points = (*self._body.sites, *self._body.cameras, *self._body.lights)
        return [point for point in points if self._is_beyond(place_of(point))]

    def piece_of(self, geom: mujoco.MjsGeom) -> NearPart:
        """Return the part of a geom on the near side; one without a length goes by its middle."""
        ends, axis = self._ends(geom)
        if ends is None:
            return NearPart(place_of(geom), float(not self._is_beyond(place_of(geom))), axis)
        inner, outer = (self._share(end) for end in ends)
        near = ends[0]
        if inner > outer:
            near, inner, outer = ends[1], outer, inner
        if outer <= self._part + _SAME or inner >= self._part - _SAME:
            return NearPart(near, float(outer <= self._part + _SAME), axis)
        # Exact for a geom that spans the segment.
        if np.allclose(near, self._held, 0.0, _SAME):
            near, inner = self._held, 0.0
        outer = 1.0 if abs(outer - 1.0) < _SAME else outer
        return NearPart(near, (self._part - inner) / (outer - inner), axis)

    def _ends(self, geom: mujoco.MjsGeom) -> tuple[tuple[Array, Array] | None, int]:
        """Return both ends of a geom's length, and the index of the half-size that it is."""
        if geom.type in LONG:
            return axis_ends(geom), 1
        if geom.type != _G.mjGEOM_BOX:
            return None, 0
        if has_ends(geom):
            return (np.array(geom.fromto[:3]), np.array(geom.fromto[3:])), 2
        axes = rotation(orientation(geom))
        along = np.abs(self.along @ axes) / float(np.linalg.norm(self.along))
        axis = int(np.argmax(along))
        if along[axis] >= _ALONG:
            half = axes[:, axis] * geom.size[axis]
            return (geom.pos - half, geom.pos + half), axis
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8)
        corners = ((axes * geom.size) @ signs).T
        if len({self._is_beyond(geom.pos + corner) for corner in corners}) == 2:
            raise MorphologyError(
                f"{geom.name!r} lies oblique to the plane that would cut it in two: cut "
                f"{self._body.name!r} elsewhere."
            )
        return None, axis


def shorten(geom: mujoco.MjsGeom, piece: NearPart, share: float) -> None:
    """Shorten a geom to a share of its length, at the same thickness and density.

    The near end of the piece stays.
    """
    with same_density(geom):
        if has_ends(geom):
            geom.fromto = (piece.near + share * (geom.fromto.reshape(2, 3) - piece.near)).ravel()
        else:
            size = np.array(geom.size)
            size[piece.axis] *= share
            geom.size = size
            geom.pos = piece.near + share * (geom.pos - piece.near)
