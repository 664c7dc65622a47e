"""Make implicit parts of a model explicit: names, frames, fitted shapes and bounds of mass.

Edits change numbers in place. An element without a name cannot be selected, a pose relative to a
frame has other axes than its body, and a size, mass or inertia that the compiler sets undoes any
change.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import compiled, limbs_and_trunks, name_elements
from shapechanger.morphology.spec.geometry import Array, has_ends, orientation, rotation, scale_mass

LEAST_MASS: Final = 1e-14
"""Ten times the mass and the inertia of a body that MuJoCo refuses, kg and kg·m²."""

_UPRIGHT: Final = (1.0, 0.0, 0.0, 0.0)


def make_explicit(spec: mujoco.MjSpec) -> None:
    """Name every element, and write out whatever the compiler would derive again, in place.

    These are frames, a total mass, least masses and inertias, and primitives that are fitted to
    meshes. The physics does not change.

    Raises:
        MorphologyError: If a frame scales its elements, or a least mass cannot be written out.
    """
    name_elements(spec)
    resolve_frames(spec)
    if spec.compiler.settotalmass > 0.0:
        total = spec.compiler.settotalmass
        spec.compiler.settotalmass = -1.0
        factor = total / float(spec.copy().compile().body_mass.sum())
        for body in limbs_and_trunks(spec):
            scale_mass(body, factor)
    _write_out_bounds(spec)
    _write_out_fits(spec)


def _write_out_bounds(spec: mujoco.MjSpec) -> None:
    """Give the bodies that the compiler makes heavier their final inertia, and drop the bounds."""
    compiler = spec.compiler
    if max(compiler.boundmass, compiler.boundinertia) <= LEAST_MASS:
        return
    bounded = compiled(spec)
    compiler.boundmass = min(compiler.boundmass, LEAST_MASS)
    compiler.boundinertia = min(compiler.boundinertia, LEAST_MASS)
    free = compiled(spec)
    for body in limbs_and_trunks(spec):
        final, own = bounded.body(body.name), free.body(body.name)
        if final.mass == own.mass and np.array_equal(final.inertia, own.inertia):
            continue
        if compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
            raise MorphologyError(
                f"The least mass or inertia of the compiler raises that of {body.name!r}, which "
                "would undo an edit: give the body a denser geom, or drop boundmass and "
                "boundinertia."
            )
        body.explicitinertial = True
        body.mass, body.ipos, body.iquat = final.mass[0], final.ipos, final.iquat
        body.inertia, body.fullinertia = final.inertia, np.full(6, np.nan)
        body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def _write_out_fits(spec: mujoco.MjSpec) -> None:
    """Write out the size and place of primitives that are fitted to a mesh."""
    meshes = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    fitted = [e for e in (*spec.geoms, *spec.sites) if e.meshname and e.type not in meshes]
    if not fitted:
        return
    model = compiled(spec)
    for element in fitted:
        kind = model.geom if isinstance(element, mujoco.MjsGeom) else model.site
        final = kind(element.name)
        element.meshname = ""
        element.size, element.pos, element.quat = final.size, final.pos, final.quat
        element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def resolve_frames(spec: mujoco.MjSpec) -> None:
    """Express every pose relative to its body, and reset the frames.

    Raises:
        MorphologyError: If a frame scales its elements.
    """
    frames = [frame for frame in spec.frames if not _is_trivial(frame)]
    if not frames:
        return
    for frame in frames:
        if np.any(frame.scale != 1.0) or frame.massscale:
            raise MorphologyError(
                f"The frame {frame.name!r} scales its elements: write the sizes out instead."
            )
    for body in limbs_and_trunks(spec):
        _resolve(spec, body)
    for element in (*spec.geoms, *spec.sites, *spec.cameras):
        _resolve(spec, element)
    for joint in spec.joints:
        pose = _pose_of_frames(spec, joint.frame)
        if pose:
            joint.pos = _seen(joint.pos, pose)
            joint.axis = rotation(pose.turn) @ joint.axis
    for light in spec.lights:
        pose = _pose_of_frames(spec, light.frame)
        if pose:
            light.pos = _seen(light.pos, pose)
            light.dir = rotation(pose.turn) @ light.dir
    for frame in frames:
        frame.pos = np.zeros(3)
        frame.quat = _UPRIGHT
        frame.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def _is_trivial(frame: mujoco.MjsFrame) -> bool:
    """Return whether a frame changes nothing."""
    return (
        not np.any(frame.pos)
        and tuple(frame.quat) == _UPRIGHT
        and frame.alt.type == mujoco.mjtOrientation.mjORIENTATION_QUAT
        and bool(np.all(frame.scale == 1.0))
        and not frame.massscale
    )


def _resolve(
    spec: mujoco.MjSpec,
    element: mujoco.MjsBody | mujoco.MjsGeom | mujoco.MjsSite | mujoco.MjsCamera,
) -> None:
    """Express an element's pose relative to its body."""
    pose = _pose_of_frames(spec, element.frame)
    if pose is None:
        return
    if isinstance(element, mujoco.MjsGeom | mujoco.MjsSite) and has_ends(element):
        if element.type != mujoco.mjtGeom.mjGEOM_BOX:
            element.fromto = np.concatenate([_seen(e, pose) for e in element.fromto.reshape(2, 3)])
            return
        _write_pose(element)  # The turn of a box about its axis follows from the frame.
    element.pos = _seen(element.pos, pose)
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, pose.turn, orientation(spec, element))
    element.quat = turned
    element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def _write_pose(element: mujoco.MjsGeom | mujoco.MjsSite) -> None:
    """Replace the ends of an element by position and orientation, as MuJoCo does."""
    first, last = element.fromto.reshape(2, 3)
    axis = first - last
    length = float(np.linalg.norm(axis))
    quaternion = np.empty(4)
    mujoco.mju_quatZ2Vec(quaternion, axis / length)
    element.pos, element.quat = 0.5 * (first + last), quaternion
    element.size = [element.size[0], element.size[0], 0.5 * length]
    element.fromto = np.full(6, np.nan)


class _Pose(NamedTuple):
    """Pose of frames in their body's frame: quaternion (w, x, y, z) and position, m."""

    turn: Array
    shift: Array


def _seen(point: Array, pose: _Pose) -> Array:
    """Return a point of a frame relative to the body, m."""
    return pose.shift + rotation(pose.turn) @ point


def _pose_of_frames(spec: mujoco.MjSpec, frame: mujoco.MjsFrame | None) -> _Pose | None:
    """Return the pose of nested frames relative to the body; None without a frame."""
    pose = None
    while frame is not None:
        around = _Pose(orientation(spec, frame), np.array(frame.pos))
        if pose is None:
            pose = around
        else:
            turn = np.empty(4)
            mujoco.mju_mulQuat(turn, around.turn, pose.turn)
            pose = _Pose(turn, _seen(pose.shift, around))
        frame = frame.frame
    return pose
