"""Find elements of a model, name them, and make explicit the values that the compiler derives.

Edits change numbers in place. An element without a name cannot be selected, a pose relative to a
frame has other axes than its body, and a size, mass or inertia that the compiler sets undoes any
change.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, TypeVar

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology.spec.geometry import (
    UPRIGHT,
    has_ends,
    orientation,
    points_of,
    product,
    rotation,
    scale_mass,
    set_orientation,
    set_points,
)
from shapechanger.morphology.spec.references import kind_of

LEAST_MASS: Final = 1e-14
"""Ten times the mass and the inertia of a body that MuJoCo refuses, kg and kg·m²."""

_N = TypeVar("_N", bound=Any)


def select(kind: str, pattern: str, elements: Iterable[_N]) -> list[_N]:
    """Return the elements whose name is `pattern` or matches it as a glob, in the model's order.

    Args:
        kind: Kind of element for the message, such as "body".
        pattern: A name, or a glob such as `*shank*`.
        elements: The elements to select from.

    Raises:
        UnknownName: If none matches.
    """
    candidates = list(elements)
    found = [element for element in candidates if element.name == pattern]
    found = found or [e for e in candidates if fnmatch.fnmatchcase(e.name, pattern)]
    if not found:
        raise UnknownName(kind, pattern, [element.name for element in candidates])
    return found


def select_limbs(spec: mujoco.MjSpec, pattern: str, change: str) -> Iterator[mujoco.MjsBody]:
    """Yield the bodies that match and are there still, since a change may remove others.

    The change, such as "cut", is for the message that refuses a trunk: a body on the world, which
    carries the whole robot.
    """
    for name in [body.name for body in select("body", pattern, spec.bodies[1:])]:
        if (body := spec.body(name)) is None:
            continue
        if body.parent.parent is None:
            raise MorphologyError(
                f"{name!r} is the trunk that carries all limbs, so it cannot be {change}; "
                f"its limbs can: {', '.join(child.name for child in body.bodies) or 'it has none'}."
            )
        yield body


def require_free_name(spec: mujoco.MjSpec, kind: str, name: str) -> None:
    """Refuse a name that is empty, or that an element of the kind, such as "body", has."""
    elements = getattr(spec, {"body": "bodies", "equality": "equalities"}.get(kind, f"{kind}s"))
    if not name or any(element.name == name for element in elements):
        raise MorphologyError(f"A new {kind} needs an unused name, got {name!r}.")


def name_elements(spec: mujoco.MjSpec, bodies_by_joint: Mapping[str, str] | None = None) -> None:
    """Name every body, joint, geom, site, camera, light and actuator without a name, in place.

    A body is named after `bodies_by_joint`, or its joint, or its parent; an actuator after the
    element that it drives; anything else after its body. Names change no physics.

    Args:
        spec: The model.
        bodies_by_joint: Names for unnamed bodies by the names of their joints.
    """
    chosen = bodies_by_joint or {}
    free = unique_namer(body.name for body in spec.bodies)
    for body in spec.bodies[1:]:
        if not body.name:
            joint = next((j.name for j in body.joints if j.name), "")
            body.name = free(chosen.get(joint, joint or f"{body.parent.name}_part"))
    for elements in (spec.joints, spec.geoms, spec.sites, spec.cameras, spec.lights):
        free = unique_namer(element.name for element in elements)
        for element in elements:
            element.name = element.name or free(f"{element.parent.name}_{kind_of(element)}")
    free = unique_namer(actuator.name for actuator in spec.actuators)
    for actuator in spec.actuators:
        actuator.name = actuator.name or free(actuator.target)


def unique_namer(taken: Iterable[str], numbered: str = "_{}") -> Callable[[str], str]:
    """Return a function that returns the name it is given, `numbered` if that is taken by now."""
    used = set(taken)

    def free(name: str) -> str:
        candidate, count = name, 1
        while candidate in used:
            count += 1
            candidate = name + numbered.format(count)
        used.add(candidate)
        return candidate

    return free


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a copy in which every body stands for itself, in its own frame."""
    copy = spec.copy()
    copy.compiler.fusestatic = copy.compiler.alignfree = copy.compiler.discardvisual = False
    return copy.compile()


def make_explicit(spec: mujoco.MjSpec) -> None:
    """Name every element, and write out all values that the compiler would derive, in place.

    These are frames, a total mass, least masses and inertias, and primitives that are fitted to
    meshes. The physics does not change.
    """
    name_elements(spec)
    resolve_frames(spec)
    if spec.compiler.settotalmass > 0.0:
        total, spec.compiler.settotalmass = spec.compiler.settotalmass, -1.0
        factor = total / float(spec.copy().compile().body_mass.sum())
        for body in spec.bodies[1:]:
            scale_mass(body, factor)
    _write_out_bounds(spec)
    meshes = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    fitted = [e for e in (*spec.geoms, *spec.sites) if e.meshname and e.type not in meshes]
    model: Any = compiled(spec) if fitted else None
    for element in fitted:
        final = getattr(model, kind_of(element))(element.name)
        element.meshname = ""
        element.size, element.pos = final.size, final.pos
        set_orientation(element, final.quat)


def _write_out_bounds(spec: mujoco.MjSpec) -> None:
    """Give the bodies that the compiler makes heavier their final inertia, and drop the bounds."""
    compiler = spec.compiler
    if max(compiler.boundmass, compiler.boundinertia) <= LEAST_MASS:
        return
    bounded = compiled(spec)
    compiler.boundmass = min(compiler.boundmass, LEAST_MASS)
    compiler.boundinertia = min(compiler.boundinertia, LEAST_MASS)
    free = compiled(spec)
    for body in spec.bodies[1:]:
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


def resolve_frames(spec: mujoco.MjSpec) -> None:
    """Express every pose relative to its body, and reset the frames; refuse those that scale."""
    for frame in spec.frames:
        if np.any(frame.scale != 1.0) or frame.massscale:
            raise MorphologyError(
                f"The frame {frame.name!r} scales its elements: write the sizes out instead."
            )
    if all(not np.any(f.pos) and np.array_equal(orientation(f), UPRIGHT) for f in spec.frames):
        return
    points = (*spec.geoms, *spec.sites, *spec.cameras, *spec.joints, *spec.lights)
    for element in (*spec.bodies[1:], *points):
        around: Any = element.frame
        if around is not None:
            turn, shift = orientation(around), np.array(around.pos)
            while (around := around.frame) is not None:
                outer = orientation(around)
                turn, shift = product(outer, turn), around.pos + rotation(outer) @ shift
            _resolve(element, turn, shift)
    for frame in spec.frames:
        frame.pos = np.zeros(3)
        set_orientation(frame, UPRIGHT)


def _resolve(element: Any, turn: np.ndarray, shift: np.ndarray) -> None:
    """Express the pose of an element relative to its body, from that relative to a frame."""
    if has_ends(element) and element.type == mujoco.mjtGeom.mjGEOM_BOX:
        # The turn of a box about its axis follows from the frame: write its pose, as MuJoCo does.
        first, last = points_of(element)
        length, upwards = float(np.linalg.norm(first - last)), np.empty(4)
        mujoco.mju_quatZ2Vec(upwards, (first - last) / length)
        element.pos, element.quat = 0.5 * (first + last), upwards
        element.size = [element.size[0], element.size[0], 0.5 * length]
        element.fromto = np.full(6, np.nan)
    matrix = rotation(turn)
    set_points(element, np.array([shift + matrix @ point for point in points_of(element)]))
    if hasattr(element, "quat") and not has_ends(element):
        set_orientation(element, product(turn, orientation(element)))
    for direction in ("axis", "dir"):
        if hasattr(element, direction):
            setattr(element, direction, matrix @ getattr(element, direction))
