"""Find, name, copy and move elements of a model, and write out what the compiler derives.

Edits change numbers in place. An element without a name cannot be selected, a pose relative to a
frame has other axes than its body, and a size, mass or inertia that the compiler sets undoes any
change.
"""

from __future__ import annotations

import fnmatch
import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, TypeVar, cast

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
from shapechanger.morphology.spec.references import (
    COUPLINGS,
    Element,
    elements_of,
    key_of,
    kind_of,
    mentions,
    parts_of,
    path_of,
    release_drawings,
    whole,
)

LEAST_MASS: Final = 1e-14
"""Ten times the limit of mass and inertia, kg and kg·m², below which MuJoCo refuses a body."""

_O: Final = mujoco.mjtObj
_W: Final = mujoco.mjtWrap
_OLD: Final = "~old"  # Suffix of temporary names, while another element still has the name.
# Not copied: names must be unique, and orientations are in the units of each element.
_APART: Final = ("name", "alt", "ialt", "quat", "iquat", "classname", "childclass", "info")

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
    """Yield the bodies that match, except those that the change has removed in the meantime.

    The message that refuses a trunk, a body on the world, names the change, such as "cut".
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
        bodies_by_joint: Names for unnamed bodies, keyed by the names of their joints.
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
    """Return a function that returns an unused name: `numbered` is added to a used one."""
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
    """Compile a copy without merging, realigning or discarding any body or geom."""
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
    """Express every pose relative to its body, and reset the frames; refuse frames that scale."""
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
    if has_ends(element) and element.type == mujoco.mjtGeom.mjGEOM_BOX:
        # The ends of a box do not give its turn about its axis: write its pose, as MuJoCo does.
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


def copy_element(spec: mujoco.MjSpec, element: Any, place: Any, name: str) -> Any:
    """Add a copy of one element, with an unused or empty name, that refers to the same elements.

    A body is copied without the elements attached to it, a tendon without its path. The copy is
    added to `place`: a body or frame, or `spec` for an element that is not on a body.
    """
    kind = kind_of(element)
    if name:
        require_free_name(spec, kind, name)
    if hasattr(element, "plugin") and element.plugin.active:
        raise MorphologyError(f"{element.name!r} is driven by a plugin, so it cannot be copied.")
    copy = getattr(place, f"add_{kind}")()
    for field in _fields_of(element.__class__):
        setattr(copy, field, getattr(element, field))
    if hasattr(element, "quat"):
        copy.quat = orientation(element)
    if isinstance(element, mujoco.MjsBody):
        copy.iquat = orientation(element, "iquat", "ialt")
    # Limits of attached models can have other units than the limits of added elements.
    turns = isinstance(element, mujoco.MjsJoint) and element.type != mujoco.mjtJoint.mjJNT_SLIDE
    if turns and element.compiler.degree != copy.compiler.degree:
        convert = np.rad2deg if copy.compiler.degree else np.deg2rad
        for field in ("range", "ref", "springref"):
            setattr(copy, field, convert(getattr(element, field)))
    copy.name = name
    return copy


@functools.cache
def _fields_of(kind: type) -> tuple[str, ...]:
    settable = [name for name in dir(kind) if getattr(getattr(kind, name), "fset", None)]
    return tuple(name for name in settable if name not in _APART)


def _copy_whole(
    spec: mujoco.MjSpec, element: Any, place: Any, renamed: Callable[[str], str]
) -> Any:
    copy = copy_element(spec, element, place, element.name and renamed(element.name))
    for part in parts_of(element):
        _copy_whole(spec, part, copy, renamed)
    return copy


def move(spec: mujoco.MjSpec, element: Any, parent: mujoco.MjsBody) -> Any:
    """Attach a limb or a point to another body, with the same name and pose in the body's frame.

    Return the new element; the old handle is invalid.
    """
    # References are by name: after renaming, they refer to the copies.
    for each in whole(element):
        each.name += _OLD
    moved = _copy_whole(spec, element, parent, lambda name: name.removesuffix(_OLD))
    spec.delete(element)
    return moved


def share_contacts(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, part: mujoco.MjsBody, cut: dict[str, str]
) -> None:
    """Give the farther part of a segment the exclusions and contact pairs of the whole.

    `cut` maps the name of the nearer half of each divided geom to the name of the farther half.
    """
    halves = {key_of(body): part.name}
    halves |= {(_O.mjOBJ_GEOM, near): far for near, far in cut.items()}
    for mention in mentions(spec, "exclude", "pair"):
        if far := halves.get(mention.element):
            name = mention.holder.name and f"{mention.holder.name}_of_{part.name}"
            setattr(copy_element(spec, mention.holder, spec, name), mention.field, far)


def copy_limb(
    spec: mujoco.MjSpec, limb: mujoco.MjsBody, suffix: str, angle: float
) -> mujoco.MjsBody:
    """Add a turned copy of a limb, with a copy of each element that refers to the limb.

    If tendons or pins of the limb begin at points of the parent body, these points are copied and
    turned too. Other elements outside the limb are shared. All copies have the suffix. The turn is
    about the z axis of the limb's parent, rad. The first body of the copy is returned.
    """
    turn = np.array([math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)])
    # Mentions are read before the copy exists, because its cameras name elements too.
    inside, parent, named = elements_of(limb), limb.parent, mentions(spec)
    turned = set[Element]()
    release_drawings(spec, inside, skins=False)
    first = _copy_whole(spec, limb, parent.add_frame(quat=turn), lambda name: name + suffix)
    resolve_frames(spec)

    def name_of(kind: mujoco.mjtObj, name: str) -> str:
        """Return the name of the copy of an element, or the element's own name if it is shared.

        The first call for a site or geom of the body that carries the limb copies it.
        """
        new = name + suffix
        if (kind, name) in inside or (kind, name) in turned:
            return new
        finders = {_O.mjOBJ_SITE: spec.site, _O.mjOBJ_GEOM: spec.geom}
        point = finders[kind](name) if kind in finders else None
        if point is None or point.parent != parent or parent.parent is None:
            return name
        copy = copy_element(spec, point, parent, new)
        set_points(copy, points_of(copy) @ rotation(turn).T)
        copy.quat = product(turn, copy.quat)
        if kind == _O.mjOBJ_GEOM:  # Only a tendon bends around the copy, so it needs no mass.
            copy.mass, copy.contype, copy.conaffinity = 0.0, 0, 0
        turned.add((kind, name))
        return new

    # Sensors come last, because they may refer to the others.
    holders = (*spec.tendons, *spec.equalities, *spec.excludes, *spec.pairs)
    for holder in cast("list[Any]", [*holders, *spec.actuators, *spec.sensors]):
        own = [mention for mention in named if mention.holder == holder]
        # An actuator with only its `refsite` on the limb moves another limb.
        moves = (m for m in own if m.kind != "actuator" or m.field != "refsite")
        if not any(mention.element in inside for mention in moves):
            continue
        is_equality = isinstance(holder, mujoco.MjsEquality)
        coupled = is_equality and COUPLINGS.get(holder.type)
        if coupled and (coupled, holder.name1) not in inside:
            raise MorphologyError(
                f"{holder.name1!r} follows {holder.name2!r}, and cannot follow a copy of it too: "
                "copy a limb that holds both."
            )
        copy = copy_element(spec, holder, spec, holder.name and holder.name + suffix)
        if isinstance(holder, mujoco.MjsTendon):
            _copy_path(holder, copy, name_of)
            own = []
        for mention in own:
            name = mention.element[1]
            if is_equality or isinstance(holder, mujoco.MjsActuator):
                name = name_of(*mention.element)
            elif mention.element in inside:
                name += suffix
            setattr(copy, mention.field, name)
        inside.add(key_of(holder))
    for holder, _, element in named:
        kind = kind_of(holder)
        if kind in ("camera", "light") and {key_of(holder), element} <= inside:
            getattr(spec, kind)(holder.name + suffix).targetbody = element[1] + suffix
    return first


def _copy_path(
    tendon: mujoco.MjsTendon, copy: mujoco.MjsTendon, name_of: Callable[[mujoco.mjtObj, str], str]
) -> None:
    for wrap in path_of(tendon):
        match wrap.type:
            case _W.mjWRAP_PULLEY:
                copy.wrap_pulley(wrap.divisor)
            case _W.mjWRAP_JOINT:
                copy.wrap_joint(name_of(_O.mjOBJ_JOINT, wrap.target.name), wrap.coef)
            case _W.mjWRAP_SITE:
                copy.wrap_site(name_of(_O.mjOBJ_SITE, wrap.target.name))
            case _:
                side = wrap.sidesite
                side_site = name_of(_O.mjOBJ_SITE, side.name) if side else ""
                copy.wrap_geom(name_of(_O.mjOBJ_GEOM, wrap.target.name), side_site)
