"""Copy, move and resize limbs, geoms and sites within a model, and copy what names them."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import require_free_name, resolve_frames
from shapechanger.morphology.spec.geometry import (
    Point,
    anchor,
    carry_outwards,
    has_ends,
    orientation,
    product,
    require_geometry,
    resize_geom,
    rotation,
)
from shapechanger.morphology.spec.joints import scale_resistance, scale_strength
from shapechanger.morphology.spec.references import (
    COUPLINGS,
    Element,
    elements_of,
    elements_on,
    key_of,
    kind_of,
    moves_only,
    path_elements,
    path_of,
    references,
    release_drawings,
    subtree,
)

_O: Final = mujoco.mjtObj
# In a name while another element still has it; no name of a model has it.
_OLD: Final = "~old"
# Set apart: names are unique, and orientations are written in units that belong to each element.
_APART: Final = frozenset(
    {"name", "alt", "ialt", "quat", "iquat", "classname", "childclass", "info"}
)
_IN_DEGREES: Final = ("range", "ref", "springref")


def copy_limb(
    spec: mujoco.MjSpec, limb: mujoco.MjsBody, suffix: str, angle: float
) -> mujoco.MjsBody:
    """Add a turned copy of a limb, with a copy of all that names its elements.

    Points of the body that carries the limb, where tendons and pins begin, are copied and turned
    with it; any other element that is named together with one of the limb is shared.

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.
        suffix: Appended to the names of all copied elements.
        angle: Turn about the z axis of the limb's parent, rad.

    Returns:
        The first body of the copy.

    Raises:
        MorphologyError: If a new name is taken, or an element cannot be copied.
    """
    turn = np.array([math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)])
    inside = elements_of(limb)
    release_drawings(spec, inside, skins=False)
    copied = _Copies(spec, limb, suffix, turn, inside)
    copy = _copy_body(spec, limb, limb.parent.add_frame(quat=turn), lambda name: name + suffix)
    resolve_frames(spec)
    copied.copy_holders()
    return copy


def move_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, parent: mujoco.MjsBody) -> mujoco.MjsBody:
    """Attach a limb to another body, at the same pose in its frame; what names it still does.

    Returns:
        The new body; the old handle is invalid.
    """
    # References are by name: under another name the old elements go without them.
    for body in subtree(limb):
        for element in (body, *elements_on(body)):
            element.name += _OLD
    moved = _copy_body(spec, limb, parent, lambda name: name.removesuffix(_OLD))
    spec.delete(limb)
    return moved


def move_point(spec: mujoco.MjSpec, point: Point, body: mujoco.MjsBody) -> Any:
    """Move a site, geom, camera or light to another body, to the same pose in its frame.

    Returns:
        The new element; the old handle is invalid.
    """
    name = point.name
    point.name = name + _OLD  # References are by name.
    moved = copy_element(spec, point, body, name)
    spec.delete(point)
    return moved


def _copy_body(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    place: mujoco.MjsBody | mujoco.MjsFrame,
    renamed: Callable[[str], str],
) -> mujoco.MjsBody:
    """Copy a body with all that hangs on it."""
    copy = copy_element(spec, body, place, renamed(body.name))
    for element in elements_on(body):
        copy_element(spec, element, copy, element.name and renamed(element.name))
    for child in body.bodies:
        _copy_body(spec, child, copy, renamed)
    return copy


def copy_element(spec: mujoco.MjSpec, element: Any, place: Any, name: str) -> Any:
    """Add a copy of one element, which names the same others.

    Args:
        spec: Specification that contains it.
        element: The element; a body is copied without what hangs on it, a tendon without its path.
        place: The body or frame that the copy is added to, or `spec` for an element on no body.
        name: Name of the copy; empty for none.

    Raises:
        MorphologyError: If the name is taken, or a plugin drives the element.
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
        copy.quat = orientation(spec, element)
    if isinstance(element, mujoco.MjsBody):
        copy.iquat = orientation(spec, element, of_inertia=True)
    # Limits of attached models can have other units than those of elements that are added.
    turns = isinstance(element, mujoco.MjsJoint) and element.type != mujoco.mjtJoint.mjJNT_SLIDE
    if turns and element.compiler.degree != copy.compiler.degree:
        convert = np.rad2deg if copy.compiler.degree else np.deg2rad
        for field in _IN_DEGREES:
            setattr(copy, field, convert(getattr(element, field)))
    copy.name = name
    return copy


@functools.cache
def _fields_of(kind: type) -> tuple[str, ...]:
    """Return the fields of a kind of element that can be set, apart from those in `_APART`."""
    settable = [name for name in dir(kind) if getattr(getattr(kind, name), "fset", None)]
    return tuple(name for name in settable if name not in _APART)


def resize_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody, factor: float) -> None:
    """Scale a limb in size and strength, in place, with everything attached to it.

    Raises:
        MorphologyError: If a body of it cannot be reshaped, or an actuator cannot be scaled.
    """
    for body in subtree(limb):
        require_geometry(spec, body)
        held = anchor(body)
        for geom in body.geoms:
            resize_geom(spec, geom, held, factor)
        carry_outwards(spec, body, held, factor)
        for joint in body.joints:
            scale_resistance(joint, factor)
    elements = elements_of(limb)
    release_drawings(spec, elements)
    for tendon in spec.tendons:
        path = {*path_elements(tendon)}
        if path.isdisjoint(elements) or not moves_only(spec, tendon, elements):
            continue
        elements.add(key_of(tendon))
        scale_resistance(tendon, factor)
        if path <= elements and _O.mjOBJ_JOINT not in {kind for kind, _ in path}:
            tendon.range = tendon.range * factor
            # A negative length stands for the length in the reference pose.
            lengths = np.array(tendon.springlength)
            tendon.springlength = np.where(lengths > 0.0, lengths * factor, lengths)
    for mention in references(spec, "actuator"):
        strong = mention.element[0] in (_O.mjOBJ_JOINT, _O.mjOBJ_TENDON)
        if strong and mention.element in elements:
            scale_strength(mention.holder, factor)


# --- Elements that name others -----------------------------------------------------------------


class _Copies:
    """Copies of all that names the elements of a limb, with the arguments of `copy_limb`."""

    def __init__(
        self,
        spec: mujoco.MjSpec,
        limb: mujoco.MjsBody,
        suffix: str,
        turn: np.ndarray,
        inside: set[Element],
    ) -> None:
        self._spec, self._suffix, self._turn = spec, suffix, turn
        # The elements of the limb; those that are copied with it are added.
        self._parent, self._inside = limb.parent, inside
        # Points of the parent that have been copied and turned.
        self._turned: set[Element] = set()
        # Before there is a copy, whose cameras name elements too.
        self._references = references(spec)

    def copy_holders(self) -> None:
        """Copy tendons, then equalities, contacts, actuators and sensors, and aim the cameras."""
        spec, inside = self._spec, self._inside
        for tendon in [each for each in spec.tendons if self._names_inside(each)]:
            self._copy_tendon(tendon)
            inside.add(key_of(tendon))
        for equality in spec.equalities:
            self._require_own_follower(equality)
        # Sensors last: they may name the others.
        holders = (*spec.equalities, *spec.excludes, *spec.pairs, *spec.actuators, *spec.sensors)
        for holder in holders:
            # An actuator whose other end alone is on the limb moves another limb.
            moves = isinstance(holder, mujoco.MjsActuator)
            if self._names_inside(holder, *(("target", "slidersite") if moves else ())):
                self._copy_holder(holder)
                inside.add(key_of(holder))
        for mention in self._references:
            aims = mention.kind in ("camera", "light") and key_of(mention.holder) in inside
            if aims and mention.element in inside:
                copy = getattr(spec, mention.kind)(mention.holder.name + self._suffix)
                copy.targetbody = mention.element[1] + self._suffix

    def _names_inside(self, holder: Any, *fields: str) -> bool:
        """Return whether an element names one of the limb, in some of its fields or in any."""
        return any(
            each.element in self._inside
            for each in self._references
            if each.holder == holder and (not fields or each.field in fields)
        )

    def _require_own_follower(self, equality: mujoco.MjsEquality) -> None:
        """Refuse a coupling that would lead an element outside of the limb twice."""
        kind = COUPLINGS.get(equality.type)
        if kind is None or (kind, equality.name1) in self._inside:
            return
        if (kind, equality.name2) in self._inside:
            raise MorphologyError(
                f"{equality.name1!r} follows {equality.name2!r}, and cannot follow a copy of it "
                "too: copy a limb that holds both."
            )

    def _copy_holder(self, holder: Any) -> Any:
        """Copy an element that names one of the limb, without the path of a tendon."""
        name = holder.name and holder.name + self._suffix
        copy = copy_element(self._spec, holder, self._spec, name)
        tied = isinstance(holder, mujoco.MjsEquality | mujoco.MjsActuator)
        for mention in self._references:
            if mention.holder == holder and mention.kind != "tendon":
                own = self._suffix if mention.element in self._inside else ""
                new = self._name(*mention.element) if tied else mention.element[1] + own
                setattr(copy, mention.field, new)
        return copy

    def _copy_tendon(self, tendon: mujoco.MjsTendon) -> None:
        """Copy a tendon, with the points of its path outside of the limb turned."""
        copy = self._copy_holder(tendon)
        kinds = mujoco.mjtWrap
        for wrap in path_of(tendon):
            if wrap.type == kinds.mjWRAP_PULLEY:
                copy.wrap_pulley(wrap.divisor)
                continue
            name = wrap.target.name
            if wrap.type == kinds.mjWRAP_JOINT:
                copy.wrap_joint(self._name(_O.mjOBJ_JOINT, name), wrap.coef)
            elif wrap.type == kinds.mjWRAP_SITE:
                copy.wrap_site(self._name(_O.mjOBJ_SITE, name))
            else:
                side = wrap.sidesite
                side_site = self._name(_O.mjOBJ_SITE, side.name) if side else ""
                copy.wrap_geom(self._name(_O.mjOBJ_GEOM, name), side_site)

    def _name(self, kind: mujoco.mjtObj, name: str) -> str:
        """Return the name of the copy of an element; of one that is shared, its own.

        A site or geom of the body that carries the limb is copied when it is first asked for.
        """
        new = name + self._suffix
        if (kind, name) in self._inside or (kind, name) in self._turned:
            return new
        finders = {_O.mjOBJ_SITE: self._spec.site, _O.mjOBJ_GEOM: self._spec.geom}
        point = finders[kind](name) if kind in finders else None
        if point is None or point.parent != self._parent or self._parent.parent is None:
            return name
        copy = copy_element(self._spec, point, self._parent, new)
        matrix = rotation(self._turn)
        if has_ends(copy):
            copy.fromto = (copy.fromto.reshape(2, 3) @ matrix.T).ravel()
        copy.pos = matrix @ copy.pos
        copy.quat = product(self._turn, copy.quat)
        if isinstance(copy, mujoco.MjsGeom):  # A tendon bends around it; that needs no second mass.
            copy.mass, copy.contype, copy.conaffinity = 0.0, 0, 0
        self._turned.add((kind, name))
        return new


def share_contacts(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, part: mujoco.MjsBody, cut: dict[str, str]
) -> None:
    """Give the farther part of a segment the exclusions and contact pairs of the whole.

    `cut` has the names of the farther halves of geoms by the names of the nearer ones.
    """
    halves = {key_of(body): part.name}
    halves |= {(_O.mjOBJ_GEOM, near): far for near, far in cut.items()}
    for mention in references(spec, "exclusion", "contact pair"):
        if far := halves.get(mention.element):
            name = mention.holder.name and f"{mention.holder.name}_of_{part.name}"
            setattr(copy_element(spec, mention.holder, spec, name), mention.field, far)
