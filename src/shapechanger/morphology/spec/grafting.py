"""Copy and move limbs, geoms and sites within a model, with the elements that refer to them."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, Final, cast

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec import geometry, references, require_free_name, resolve_frames

_O: Final = mujoco.mjtObj
_W: Final = mujoco.mjtWrap
# Part of temporary names, used while another element still has the name; models do not use it.
_OLD: Final = "~old"
# Set apart: names are unique, and orientations are written in units that belong to each element.
_APART: Final = frozenset(
    {"name", "alt", "ialt", "quat", "iquat", "classname", "childclass", "info"}
)


def copy_element(spec: mujoco.MjSpec, element: Any, place: Any, name: str) -> Any:
    """Add a copy of one element, with a free name or none, which names the same others.

    A body is copied without what hangs on it, a tendon without its path. The copy is added to
    `place`, a body or frame, or for an element on no body to `spec`.
    """
    kind = references.kind_of(element)
    if name:
        require_free_name(spec, kind, name)
    if hasattr(element, "plugin") and element.plugin.active:
        raise MorphologyError(f"{element.name!r} is driven by a plugin, so it cannot be copied.")
    copy = getattr(place, f"add_{kind}")()
    for field in _fields_of(element.__class__):
        setattr(copy, field, getattr(element, field))
    if hasattr(element, "quat"):
        copy.quat = geometry.orientation(element)
    if isinstance(element, mujoco.MjsBody):
        copy.iquat = geometry.orientation(element, "iquat", "ialt")
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
    """Return the fields of a kind of element that can be set, apart from those in `_APART`."""
    settable = [name for name in dir(kind) if getattr(getattr(kind, name), "fset", None)]
    return tuple(name for name in settable if name not in _APART)


def _copy_whole(
    spec: mujoco.MjSpec, element: Any, place: Any, renamed: Callable[[str], str]
) -> Any:
    """Copy an element with all that hangs on it."""
    copy = copy_element(spec, element, place, element.name and renamed(element.name))
    for part in references.parts_of(element):
        _copy_whole(spec, part, copy, renamed)
    return copy


def move(spec: mujoco.MjSpec, element: Any, parent: mujoco.MjsBody) -> Any:
    """Attach a limb or a point to another body, at the same pose in its frame; names stay.

    The new element is returned; the old handle is invalid.
    """
    # References are by name, so renamed old elements lose them.
    for each in references.whole(element):
        each.name += _OLD
    moved = _copy_whole(spec, element, parent, lambda name: name.removesuffix(_OLD))
    spec.delete(element)
    return moved


def share_contacts(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, part: mujoco.MjsBody, cut: dict[str, str]
) -> None:
    """Give the farther part of a segment the exclusions and contact pairs of the whole.

    `cut` has the names of the farther halves of geoms by the names of the nearer ones.
    """
    halves = {references.key_of(body): part.name}
    halves |= {(_O.mjOBJ_GEOM, near): far for near, far in cut.items()}
    for mention in references.mentions(spec, "exclude", "pair"):
        if far := halves.get(mention.element):
            name = mention.holder.name and f"{mention.holder.name}_of_{part.name}"
            setattr(copy_element(spec, mention.holder, spec, name), mention.field, far)


def copy_limb(
    spec: mujoco.MjSpec, limb: mujoco.MjsBody, suffix: str, angle: float
) -> mujoco.MjsBody:
    """Add a turned copy of a limb, with a copy of all that names its elements.

    Points of the body that carries the limb, where tendons and pins begin, are copied and turned
    with it; any other element that is named together with one of the limb is shared. All names get
    the suffix. The turn is about the z axis of the limb's parent, rad. The first body is returned.
    """
    turn = np.array([math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)])
    inside, parent = references.elements_of(limb), limb.parent
    # Done before the copy exists, because its cameras name elements too.
    mentions = references.mentions(spec)
    turned: set[tuple[mujoco.mjtObj, str]] = set()
    references.release_drawings(spec, inside, skins=False)
    first = _copy_whole(spec, limb, parent.add_frame(quat=turn), lambda name: name + suffix)
    resolve_frames(spec)

    def name_of(kind: mujoco.mjtObj, name: str) -> str:
        """Return the name of the copy of an element; of one that is shared, its own.

        A site or geom of the body that carries the limb is copied when it is first asked for.
        """
        new = name + suffix
        if (kind, name) in inside or (kind, name) in turned:
            return new
        finders = {_O.mjOBJ_SITE: spec.site, _O.mjOBJ_GEOM: spec.geom}
        point = finders[kind](name) if kind in finders else None
        if point is None or point.parent != parent or parent.parent is None:
            return name
        copy = copy_element(spec, point, parent, new)
        geometry.set_points(copy, geometry.points_of(copy) @ geometry.rotation(turn).T)
        copy.quat = geometry.product(turn, copy.quat)
        if kind == _O.mjOBJ_GEOM:  # A tendon bends around it; that needs no second mass.
            copy.mass, copy.contype, copy.conaffinity = 0.0, 0, 0
        turned.add((kind, name))
        return new

    # Sensors last: they may name the others.
    holders = (*spec.tendons, *spec.equalities, *spec.excludes, *spec.pairs)
    for holder in cast("list[Any]", [*holders, *spec.actuators, *spec.sensors]):
        own = [mention for mention in mentions if mention.holder == holder]
        # An actuator with only its other end on the limb moves another limb.
        moves = (m for m in own if m.kind != "actuator" or m.field != "refsite")
        if not any(mention.element in inside for mention in moves):
            continue
        is_equality = isinstance(holder, mujoco.MjsEquality)
        coupled = is_equality and references.COUPLINGS.get(holder.type)
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
            kind, name = mention.element
            if is_equality or isinstance(holder, mujoco.MjsActuator):
                name = name_of(kind, name)
            elif mention.element in inside:
                name += suffix
            setattr(copy, mention.field, name)
        inside.add(references.key_of(holder))
    for mention in mentions:
        aims = mention.kind in ("camera", "light") and references.key_of(mention.holder) in inside
        if aims and mention.element in inside:
            copy = getattr(spec, mention.kind)(mention.holder.name + suffix)
            copy.targetbody = mention.element[1] + suffix
    return first


def _copy_path(
    tendon: mujoco.MjsTendon, copy: mujoco.MjsTendon, name_of: Callable[[mujoco.mjtObj, str], str]
) -> None:
    """Give a copy the path of a tendon, along the copies of its elements."""
    for wrap in references.path_of(tendon):
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
