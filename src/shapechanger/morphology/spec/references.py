"""References between the elements of a model, and the one rule for edits that touch them.

An edit updates every reference to an element that it changes, or refuses with one sentence. During
an edit, pins join sites, and values of keyframes are keyed by name (`carried`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from operator import attrgetter
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.geometry import is_limited

_O: Final = mujoco.mjtObj
_T: Final = mujoco.mjtTrn
_W: Final = mujoco.mjtWrap
_E: Final = mujoco.mjtEq
_S: Final = mujoco.mjtSensor
_BODY, _JOINT, _GEOM, _SITE = _O.mjOBJ_BODY, _O.mjOBJ_JOINT, _O.mjOBJ_GEOM, _O.mjOBJ_SITE

Element = tuple[mujoco.mjtObj, str]
"""Kind and name of an element."""

OF_JOINTS: Final = (_T.mjTRN_JOINT, _T.mjTRN_JOINTINPARENT)
PINS: Final = (_E.mjEQ_CONNECT, _E.mjEQ_WELD)
COUPLINGS: Final = {_E.mjEQ_JOINT: _JOINT, _E.mjEQ_TENDON: _O.mjOBJ_TENDON}
"""Equalities y - y0 = p(x - x0) of a follower y and a leader x, and the kind of both."""
MARK: Final = "pin~"
"""Prefix of temporary names during edits: of sites at the ends of pins, and of unnamed tendons."""

TARGETS: Final = {
    **dict.fromkeys(OF_JOINTS, _JOINT),
    **dict.fromkeys((_T.mjTRN_SITE, _T.mjTRN_SLIDERCRANK), _SITE),
    _T.mjTRN_TENDON: _O.mjOBJ_TENDON,
    _T.mjTRN_BODY: _BODY,
}
WRAPS: Final = {
    **{_W.mjWRAP_JOINT: _JOINT, _W.mjWRAP_SITE: _SITE},
    **dict.fromkeys((_W.mjWRAP_SPHERE, _W.mjWRAP_CYLINDER), _GEOM),
}


# Lists of elements that refer to others by name, their fields with names, and the kind of the named
# elements or a function that returns it. For a tuple, the function returns one kind for each name.
_HOLDERS: Final[tuple[tuple[str, str, Callable[[Any], Any] | mujoco.mjtObj], ...]] = (
    ("equalities", "name1 name2", lambda e: e.objtype if e.type in PINS else COUPLINGS.get(e.type)),
    ("excludes", "bodyname1 bodyname2", _BODY),
    ("pairs", "geomname1 geomname2", _GEOM),
    ("actuators", "target", lambda a: TARGETS.get(a.trntype)),
    ("actuators", "refsite slidersite", _SITE),
    ("sensors", "objname", attrgetter("objtype")),
    ("sensors", "refname", attrgetter("reftype")),
    ("cameras", "targetbody", _BODY),
    ("lights", "targetbody", _BODY),
    ("skins", "bodyname", _BODY),
    ("flexes", "vertbody nodebody", _BODY),
    ("tuples", "objname", attrgetter("objtype")),
)
# Sensors that can read all geoms of a body, and would need both parts after a split.
_OF_ALL_GEOMS: Final = (
    *(_S.mjSENS_GEOMDIST, _S.mjSENS_GEOMNORMAL, _S.mjSENS_GEOMFROMTO, _S.mjSENS_CONTACT),
)


class Mention(NamedTuple):
    """One element of a model, the holder, that names another."""

    holder: Any
    field: str  # Field of the holder that contains the name; `path` for a tendon.
    element: Element  # The element that is named.

    @property
    def kind(self) -> str:
        """Kind of the holder."""
        return kind_of(self.holder)

    def __str__(self) -> str:
        name = self.element[1]
        of = "" if name.startswith(MARK) else f" of {name!r}"
        return f"the {self.kind}" + (f" {self.holder.name!r}" if self.holder.name else of)


def mentions(spec: mujoco.MjSpec, *kinds: str) -> list[Mention]:
    """Return every reference to an element of a body, a tendon or an actuator.

    `kinds` selects kinds of holders, such as "actuator"; by default all.
    """
    found = [
        Mention(tendon, "path", key) for tendon in spec.tendons for key in path_elements(tendon)
    ]
    for elements, fields, kind in _HOLDERS:
        for holder in getattr(spec, elements):
            of: Any = kind(holder) if callable(kind) else kind
            for field in fields.split():
                names = getattr(holder, field)
                names = [names] if isinstance(names, str) else list(names)
                each: list[Any] = list(of) if elements == "tuples" else [of] * len(names)
                keys = ((_plain(k), name) for k, name in zip(each, names, strict=True))
                found += [Mention(holder, field, key) for key in keys if key[1]]
    return [mention for mention in found if not kinds or mention.kind in kinds]


def _plain(kind: Any) -> mujoco.mjtObj:
    # Sensors distinguish the two frames of a body.
    return _BODY if kind == _O.mjOBJ_XBODY else _O(kind or 0)


def kind_of(element: Any) -> str:
    """Return the kind of an element, such as "body"."""
    return type(element).__name__.removeprefix("Mjs").lower()


def key_of(element: Any) -> Element:
    """Return the kind and name of an element."""
    return getattr(_O, f"mjOBJ_{kind_of(element).upper()}"), element.name


def parts_of(element: Any) -> list[Any]:
    """Return the elements directly on a body, child bodies last; [] for another element."""
    kinds = ("joints", "geoms", "sites", "cameras", "lights", "bodies")
    return [part for kind in kinds for part in getattr(element, kind, ())]


def whole(element: Any) -> Iterator[Any]:
    """Yield an element and everything attached to it, parents first."""
    yield element
    for part in parts_of(element):
        yield from whole(part)


def elements_of(limb: mujoco.MjsBody) -> set[Element]:
    """Return all elements of a limb."""
    return {key_of(each) for each in whole(limb)}


def path_of(tendon: mujoco.MjsTendon) -> list[Any]:
    """Return the parts of a tendon's path, in order."""
    return [tendon.path[i] for i in range(len(tendon.path))]


def path_elements(tendon: mujoco.MjsTendon) -> list[Element]:
    """Return the elements that a tendon passes, side sites included, in order."""
    found: list[Element] = []
    for wrap in path_of(tendon):
        if wrap.type in WRAPS:
            found.append((WRAPS[wrap.type], wrap.target.name))
        if side := wrap.sidesite:
            found.append((_SITE, side.name))
    return found


def moves_only(spec: mujoco.MjSpec, tendon: mujoco.MjsTendon, elements: set[Element]) -> bool:
    """Return whether a tendon moves only the limb with these elements."""
    staying = {*path_elements(tendon)} - elements
    if any(kind == _JOINT for kind, _ in staying):
        return False
    carriers = set[str]()  # If there is one, all other points are on bodies fixed to each other.
    for kind, name in staying:
        body = (spec.site(name) if kind == _SITE else spec.geom(name)).parent
        while body.parent is not None and not body.joints:
            body = body.parent
        carriers.add(body.name)
    return len(carriers) < 2


def _does_something(spec: mujoco.MjSpec, tendon: mujoco.MjsTendon) -> bool:
    """Return whether a tendon exerts a force, is limited or is referred to."""
    forces = (tendon.stiffness, tendon.damping, tendon.frictionloss, tendon.armature)
    used = any(each.element == key_of(tendon) for each in mentions(spec))
    return is_limited(tendon) or any(map(np.any, forces)) or used


def release_drawings(spec: mujoco.MjSpec, touched: set[Element], *, skins: bool = True) -> None:
    """Remove skins over changed bodies, which have no physical effect; refuse parts of a flex."""
    gone: dict[str, Any] = {}
    for mention in mentions(spec, "flex", "skin"):
        if mention.element in touched:
            if mention.kind == "flex":
                raise MorphologyError(
                    f"{mention.element[1]!r} carries a part of {mention}, which would not follow: "
                    "remove the flex first."
                )
            gone[mention.holder.name] = mention.holder
    for skin in gone.values() if skins else ():
        spec.delete(skin)


def require_unnamed(spec: mujoco.MjSpec, element: Element, why: str, *kinds: str) -> None:
    """Refuse to change an element that another element names; `kinds` limits the other's kinds.

    `why` completes a sentence that begins with the element, such as "lies beyond the cut".
    """
    for mention in mentions(spec, *kinds):
        if mention.element == element:
            # The place of a pin has no name.
            name = "A pin" if element[1].startswith(MARK) else repr(element[1])
            raise MorphologyError(
                f"{name} {why}, but {mention} names it: change or remove it first."
            )


def require_divisible(spec: mujoco.MjSpec, body: mujoco.MjsBody, cut: Iterable[str]) -> None:
    """Refuse to split a segment if elements refer to it, or to a geom that would be `cut`."""
    for name in cut:
        require_unnamed(spec, (_GEOM, name), "would be cut in two", "tendon", "sensor")
    for mention in mentions(spec, "actuator", "sensor"):
        whole = mention.kind == "actuator" or mention.holder.type in _OF_ALL_GEOMS
        if whole and mention.element == key_of(body):
            raise MorphologyError(
                f"{body.name!r} cannot be split: {mention} needs all of its geoms on one body."
            )


def require_removable(spec: mujoco.MjSpec, limb: mujoco.MjsBody) -> None:
    """Refuse to remove a limb that tendons, couplings or actuators of other limbs need."""
    gone = elements_of(limb)
    for tendon in spec.tendons:
        if gone.isdisjoint(path_elements(tendon)):
            continue
        if not moves_only(spec, tendon, gone) and _does_something(spec, tendon):
            raise MorphologyError(
                f"The tendon {tendon.name!r} also moves bodies that stay without {limb.name!r}: "
                "remove or reroute the tendon first."
            )
        gone.add(key_of(tendon))
    for equality in spec.equalities:
        kind = COUPLINGS.get(equality.type)
        if kind and (kind, equality.name2) in gone and (kind, equality.name1) not in gone:
            raise MorphologyError(
                f"{equality.name1!r} follows {equality.name2!r}, which would be removed: lock one "
                "of them first."
            )
    for actuator in spec.actuators:
        stays = actuator.trntype == _T.mjTRN_SITE and (_SITE, actuator.target) not in gone
        if stays and (_SITE, actuator.refsite) in gone:
            raise MorphologyError(
                f"The actuator {actuator.name!r} acts relative to {actuator.refsite!r}, which "
                "would be removed."
            )


def remove_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody) -> None:
    """Remove a limb with all elements that have no meaning without it.

    Motors, sensors, exclusions, contact pairs, pins and couplings go with the limb, and so do the
    tendons that move it alone. Cameras and lights that aim at it aim at the body that carried it.
    """
    require_removable(spec, limb)
    gone = elements_of(limb)
    release_drawings(spec, gone)
    for aimed in (*spec.cameras, *spec.lights):
        if (_BODY, aimed.targetbody) in gone:
            aimed.targetbody = limb.parent.name
    for group in spec.tuples:
        members = zip(group.objtype, group.objname, group.objprm, strict=True)
        kept = [member for member in members if (_plain(_O(member[0])), member[1]) not in gone]
        if 0 < len(kept) < len(group.objname):  # MuJoCo deletes a tuple that still names the limb.
            group.objtype, group.objname, group.objprm = map(list, zip(*kept, strict=True))
    spec.delete(limb)


def remove_joint(
    spec: mujoco.MjSpec, joint: mujoco.MjsJoint, displacements: Mapping[str, float]
) -> None:
    """Remove a locked joint; elements coupled to it are held where the coupling puts them.

    Its motor and its sensors go with it, and so does a tendon whose joints are all locked, at these
    displacements from their references, rad or m.
    """
    name = joint.name
    _hold(spec, _E.mjEQ_JOINT, name, displacements[name])
    gone = {key_of(joint)}
    for tendon in list(spec.tendons):
        wraps = [wrap for wrap in path_of(tendon) if wrap.type == _W.mjWRAP_JOINT]
        coefficients = {wrap.target.name: float(wrap.coef) for wrap in wraps}
        if name not in coefficients:
            continue
        if coefficients.keys() <= displacements.keys():
            length = sum(coefficients[j] * displacements[j] for j in coefficients)
            _hold(spec, _E.mjEQ_TENDON, tendon.name, length)
            gone.add(key_of(tendon))
        elif _does_something(spec, tendon):
            raise MorphologyError(
                f"{name!r} is tied to other joints by the tendon {tendon.name!r}, so it cannot "
                "be removed alone."
            )
        spec.delete(tendon)
    for mention in mentions(spec, "actuator", "sensor"):  # Sensors may name the actuators.
        if mention.element in gone:
            gone.add(key_of(mention.holder))
            spec.delete(mention.holder)
    spec.delete(joint)


def _hold(spec: mujoco.MjSpec, kind: mujoco.mjtEq, name: str, locked: float) -> None:
    """Hold elements coupled to a joint or tendon locked this far from its reference, rad or m."""
    for equality in [e for e in spec.equalities if e.type == kind and name in (e.name1, e.name2)]:
        leader, polynomial = equality.name2, np.array(equality.data[:5])
        # For an equality of one element, only the constant counts.
        slope = polynomial[1] if leader else 0.0
        if leader == name:
            held, by = equality.name1, np.polynomial.polynomial.polyval(locked, polynomial)
        elif leader and np.any(polynomial[2:]):
            raise MorphologyError(
                f"{name!r} follows {leader!r} by a curve, so it cannot be locked: lock {leader!r} "
                "instead."
            )
        elif slope:
            held, by = leader, (locked - polynomial[0]) / slope
        elif abs(locked - polynomial[0]) > 1e-6:  # rad or m
            raise MorphologyError(
                f"{name!r} is held {polynomial[0]:.4g} from its reference by a coupling, so it "
                f"cannot be locked {locked:.4g} from it."
            )
        else:
            spec.delete(equality)
            continue
        equality.name1, equality.name2 = held, ""
        equality.data = np.concatenate([[float(by)], np.zeros(4), equality.data[5:]])
