"""Copy and move limbs, geoms and sites within a model, and copy what names them."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import require_free_name, subtree
from shapechanger.morphology.spec.explicit import resolve_frames
from shapechanger.morphology.spec.geometry import Point, has_ends, orientation, rotation
from shapechanger.morphology.spec.references import (
    COUPLINGS,
    Element,
    elements_of,
    path_of,
    references,
    release_drawings,
)

_O: Final = mujoco.mjtObj
# In a name while another element still has it; no name of a model has it.
_OLD: Final = "~old"
# Set apart: names are unique, and orientations are written in units that belong to each element.
_APART: Final = frozenset(
    {"name", "alt", "ialt", "quat", "iquat", "classname", "childclass", "info"}
)
_IN_DEGREES: Final = ("range", "ref", "springref")
_POINTS: Final = ("joint", "geom", "site", "camera", "light")


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

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.
        parent: The body to attach it to.

    Returns:
        The limb, which is another object now.
    """
    # References are by name: under another name the old elements go without them.
    for body in subtree(limb):
        body.name += _OLD
        for kind in _POINTS:
            for element in getattr(body, f"{kind}s"):
                element.name += _OLD
    moved = _copy_body(spec, limb, parent, lambda name: name.removesuffix(_OLD))
    spec.delete(limb)
    return moved


def copy_geom(
    spec: mujoco.MjSpec, geom: mujoco.MjsGeom, body: mujoco.MjsBody, name: str
) -> mujoco.MjsGeom:
    """Add a copy of a geom to another body, at the same pose in its frame.

    Args:
        spec: Specification that contains it.
        geom: The geom to copy.
        body: Body of the copy.
        name: Name of the copy.

    Raises:
        MorphologyError: If the name is taken.
    """
    require_free_name(spec, "geom", name)
    return _copy_point(spec, geom, body, name)


def move_point(spec: mujoco.MjSpec, point: Point, body: mujoco.MjsBody) -> Any:
    """Move a site, geom, camera or light to another body, to the same pose in its frame.

    Args:
        spec: Specification that contains it.
        point: The site, geom, camera or light.
        body: Its new body.

    Returns:
        The element, which is another object now.
    """
    name = point.name
    point.name = name + _OLD  # References are by name.
    moved = _copy_point(spec, point, body, name)
    spec.delete(point)
    return moved


def _copy_body(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    place: mujoco.MjsBody | mujoco.MjsFrame,
    renamed: Callable[[str], str],
) -> mujoco.MjsBody:
    """Copy a body with all that hangs on it."""
    copy = place.add_body()
    _copy_fields(spec, body, copy)
    copy.name = renamed(body.name)
    for kind in _POINTS:
        for element in getattr(body, f"{kind}s"):
            _copy_point(spec, element, copy, element.name and renamed(element.name))
    for child in body.bodies:
        _copy_body(spec, child, copy, renamed)
    return copy


def _copy_point(spec: mujoco.MjSpec, point: Any, body: mujoco.MjsBody, name: str) -> Any:
    """Copy an element that is on a body."""
    kind = type(point).__name__.removeprefix("Mjs").lower()
    copy = getattr(body, f"add_{kind}")()
    _copy_fields(spec, point, copy)
    copy.name = name
    return copy


def _copy_fields(spec: mujoco.MjSpec, old: Any, new: Any) -> None:
    """Copy all but the name of an element to a new one of its kind.

    Raises:
        MorphologyError: If a plugin drives the element.
    """
    if hasattr(old, "plugin") and old.plugin.active:
        raise MorphologyError(f"{old.name!r} is driven by a plugin, so it cannot be copied.")
    for field in _fields_of(old.__class__):
        setattr(new, field, getattr(old, field))
    if hasattr(old, "quat"):
        new.quat = orientation(spec, old)
    if isinstance(old, mujoco.MjsBody):
        new.iquat = orientation(spec, old, old.ialt, old.iquat)
    # Limits of attached models can have other units than those of elements that are added.
    turns = isinstance(old, mujoco.MjsJoint) and old.type != mujoco.mjtJoint.mjJNT_SLIDE
    if turns and old.compiler.degree != new.compiler.degree:
        convert = np.rad2deg if new.compiler.degree else np.deg2rad
        for field in _IN_DEGREES:
            setattr(new, field, convert(getattr(old, field)))


@functools.cache
def _fields_of(kind: type) -> tuple[str, ...]:
    """Return the fields of a kind of element that can be set, apart from those in `_APART`."""
    settable = [name for name in dir(kind) if getattr(getattr(kind, name), "fset", None)]
    return tuple(name for name in settable if name not in _APART)


# --- Elements that name others -----------------------------------------------------------------


class _Copies:
    """Copies of all that names the elements of a limb.

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.
        suffix: Appended to the names of all copied elements.
        turn: Turn of the copy about its parent, quaternion (w, x, y, z).
        inside: The elements of the limb; the tendons and actuators that are copied are added.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        limb: mujoco.MjsBody,
        suffix: str,
        turn: np.ndarray,
        inside: set[Element],
    ) -> None:
        self._spec, self._suffix, self._turn = spec, suffix, turn
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
            inside.add((_O.mjOBJ_TENDON, tendon.name))
        for equality in spec.equalities:
            self._require_own_follower(equality)
        for elements, kind, fields in (
            (spec.equalities, "equality", ()),
            (spec.excludes, "exclude", ()),
            (spec.pairs, "pair", ()),
            # One whose other end alone is on the limb moves another limb.
            (spec.actuators, "actuator", ("target", "slidersite")),
            (spec.sensors, "sensor", ()),
        ):
            for holder in [each for each in elements if self._names_inside(each, *fields)]:
                self._copy_holder(holder, kind)
                if kind == "actuator":
                    inside.add((_O.mjOBJ_ACTUATOR, holder.name))
        holders = {"camera": _O.mjOBJ_CAMERA, "light": _O.mjOBJ_LIGHT}
        for mention in self._references:
            name = mention.holder.name
            if (holders.get(mention.kind), name) in inside and mention.element in inside:
                copy = getattr(spec, mention.kind)(name + self._suffix)
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

    def _copy_holder(self, holder: Any, kind: str) -> None:
        """Copy an element that names one of the limb."""
        copy = copy_holder(self._spec, holder, kind, self._suffix)
        for mention in (each for each in self._references if each.holder == holder):
            if kind in ("equality", "actuator"):
                name = self._name(*mention.element)
            else:
                name = mention.element[1] + self._suffix * (mention.element in self._inside)
            setattr(copy, mention.field, name)

    def _copy_tendon(self, tendon: mujoco.MjsTendon) -> None:
        """Copy a tendon, with the points of its path outside of the limb turned."""
        copy = copy_holder(self._spec, tendon, "tendon", self._suffix)
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
        require_free_name(self._spec, "site" if kind == _O.mjOBJ_SITE else "geom", new)
        copy = _copy_point(self._spec, point, self._parent, new)
        matrix = rotation(self._turn)
        if has_ends(copy):
            copy.fromto = (copy.fromto.reshape(2, 3) @ matrix.T).ravel()
        copy.pos = matrix @ copy.pos
        turned = np.empty(4)
        mujoco.mju_mulQuat(turned, self._turn, copy.quat)
        copy.quat = turned
        if isinstance(copy, mujoco.MjsGeom):  # A tendon bends around it; that needs no second mass.
            copy.mass, copy.contype, copy.conaffinity = 0.0, 0, 0
        self._turned.add((kind, name))
        return new


def copy_holder(spec: mujoco.MjSpec, holder: Any, kind: str, suffix: str) -> Any:
    """Add a copy of an element that names others; it names the same ones.

    Args:
        spec: Specification that contains it.
        holder: A tendon without its path, an exclusion, contact pair, equality, actuator or sensor.
        kind: Its kind, as in `MjSpec.add_...`.
        suffix: Appended to its name, if it has one.

    Raises:
        MorphologyError: If the new name is taken, or the element cannot be copied.
    """
    if holder.name:
        require_free_name(spec, kind, holder.name + suffix)
    copy = getattr(spec, f"add_{kind}")()
    _copy_fields(spec, holder, copy)
    copy.name = holder.name and holder.name + suffix
    return copy


def share_contacts(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, part: mujoco.MjsBody, cut: dict[str, str]
) -> None:
    """Give the farther part of a segment the exclusions and contact pairs of the whole.

    Args:
        spec: Specification that contains it.
        body: The segment, now its nearer part.
        part: Its farther part.
        cut: Names of the farther parts of geoms that were cut in two, by those of the nearer ones.
    """
    halves = {(_O.mjOBJ_BODY, body.name): part.name}
    halves |= {(_O.mjOBJ_GEOM, near): far for near, far in cut.items()}
    for mention in references(spec, "exclusion", "contact pair"):
        far = halves.get(mention.element)
        if far:
            kind = "exclude" if mention.kind == "exclusion" else "pair"
            copy = copy_holder(spec, mention.holder, kind, f"_of_{part.name}")
            setattr(copy, mention.field, far)
