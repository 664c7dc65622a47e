"""References between the elements of a model, and the one rule for edits that touch them.

An edit carries along, or refuses in a sentence, whatever names an element that it touches.
`references` is the table of all that can name an element of a body. Every edit that moves, removes,
locks or copies elements goes through the functions of this module; points that loops hold are sites
meanwhile, and keyframes are kept by name (`loops`, `keyframes`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import subtree

_O: Final = mujoco.mjtObj
_T: Final = mujoco.mjtTrn
_W: Final = mujoco.mjtWrap
_E: Final = mujoco.mjtEq

Element = tuple[mujoco.mjtObj, str]
"""Kind and name of an element."""

OF_JOINTS: Final = (_T.mjTRN_JOINT, _T.mjTRN_JOINTINPARENT)
COUPLINGS: Final = {_E.mjEQ_JOINT: _O.mjOBJ_JOINT, _E.mjEQ_TENDON: _O.mjOBJ_TENDON}
"""Equalities y - y0 = p(x - x0) of a follower y and a leader x, and the kind of both."""

MARK: Final = "pin~"
"""Prefix of the sites that stand for the ends of loops while edits are applied."""

_TARGETS: Final = {
    _T.mjTRN_JOINT: _O.mjOBJ_JOINT,
    _T.mjTRN_JOINTINPARENT: _O.mjOBJ_JOINT,
    _T.mjTRN_TENDON: _O.mjOBJ_TENDON,
    _T.mjTRN_SITE: _O.mjOBJ_SITE,
    _T.mjTRN_SLIDERCRANK: _O.mjOBJ_SITE,
    _T.mjTRN_BODY: _O.mjOBJ_BODY,
}
_WRAPS: Final = {
    _W.mjWRAP_JOINT: _O.mjOBJ_JOINT,
    _W.mjWRAP_SITE: _O.mjOBJ_SITE,
    _W.mjWRAP_SPHERE: _O.mjOBJ_GEOM,
    _W.mjWRAP_CYLINDER: _O.mjOBJ_GEOM,
}
# Sensors of all geoms of a body, so of both parts after a split.
_OF_ALL_GEOMS: Final = (
    *(mujoco.mjtSensor.mjSENS_GEOMDIST, mujoco.mjtSensor.mjSENS_GEOMNORMAL),
    *(mujoco.mjtSensor.mjSENS_GEOMFROMTO, mujoco.mjtSensor.mjSENS_CONTACT),
)


class Mention(NamedTuple):
    """One element of a model that names another.

    Attributes:
        holder: The element that names.
        kind: Its kind, for messages and for `copies`.
        field: Its field that holds the name; `path` of a tendon.
        target: Kind of the named element.
        name: Name of the named element.
    """

    holder: Any
    kind: str
    field: str
    target: mujoco.mjtObj
    name: str

    def __str__(self) -> str:
        if not self.holder.name and self.name.startswith(MARK):
            return f"the {self.kind}"
        named = f"{self.holder.name!r}" if self.holder.name else f"of {self.name!r}"
        return f"the {self.kind} {named}"


def references(spec: mujoco.MjSpec) -> list[Mention]:
    """Return every reference to an element of a body, a tendon or an actuator.

    Keyframes refer to joints and actuators by their order; see `keyframes`.
    """
    return [reference for reference in _all_references(spec) if reference.name]


def _all_references(spec: mujoco.MjSpec) -> Iterator[Mention]:
    """Yield every reference, those to nothing included."""
    for tendon in spec.tendons:
        for wrap in path_of(tendon):
            if wrap.type in _WRAPS:
                yield Mention(tendon, "tendon", "path", _WRAPS[wrap.type], wrap.target.name)
            if side := wrap.sidesite:
                yield Mention(tendon, "tendon", "path", _O.mjOBJ_SITE, side.name)
    for equality in spec.equalities:
        target = COUPLINGS.get(equality.type, equality.objtype)
        if equality.type not in (*COUPLINGS, _E.mjEQ_CONNECT, _E.mjEQ_WELD):
            target = _O.mjOBJ_FLEX
        for field in ("name1", "name2"):
            yield Mention(equality, "equality", field, target, getattr(equality, field))
    for exclude in spec.excludes:
        for field in ("bodyname1", "bodyname2"):
            name = getattr(exclude, field)
            yield Mention(exclude, "exclusion", field, _O.mjOBJ_BODY, name)
    for pair in spec.pairs:
        for field in ("geomname1", "geomname2"):
            yield Mention(pair, "contact pair", field, _O.mjOBJ_GEOM, getattr(pair, field))
    for actuator in spec.actuators:
        target = _TARGETS.get(actuator.trntype, _O.mjOBJ_UNKNOWN)
        yield Mention(actuator, "actuator", "target", target, actuator.target)
        for field in ("refsite", "slidersite"):
            yield Mention(actuator, "actuator", field, _O.mjOBJ_SITE, getattr(actuator, field))
    for sensor in spec.sensors:
        yield Mention(sensor, "sensor", "objname", _plain(sensor.objtype), sensor.objname)
        yield Mention(sensor, "sensor", "refname", _plain(sensor.reftype), sensor.refname)
    for camera in spec.cameras:
        yield Mention(camera, "camera", "targetbody", _O.mjOBJ_BODY, camera.targetbody)
    for light in spec.lights:
        yield Mention(light, "light", "targetbody", _O.mjOBJ_BODY, light.targetbody)
    for skin in spec.skins:
        for name in skin.bodyname:
            yield Mention(skin, "skin", "bodyname", _O.mjOBJ_BODY, name)
    for flex in spec.flexes:
        for name in {*flex.vertbody, *flex.nodebody}:
            yield Mention(flex, "flex", "vertbody", _O.mjOBJ_BODY, name)
    for group in spec.tuples:
        for kind, name in zip(group.objtype, group.objname, strict=True):
            yield Mention(group, "tuple", "objname", _plain(_O(kind)), name)


def _plain(kind: mujoco.mjtObj) -> mujoco.mjtObj:
    """Return a body for either frame of a body, which sensors distinguish."""
    return _O.mjOBJ_BODY if kind == _O.mjOBJ_XBODY else kind


def path_of(tendon: mujoco.MjsTendon) -> list[Any]:
    """Return what a tendon passes, in order."""
    return [tendon.path[i] for i in range(len(tendon.path))]


def path_elements(spec: mujoco.MjSpec, tendon: mujoco.MjsTendon) -> set[Element]:
    """Return the elements that a tendon passes, side sites included."""
    return {
        (reference.target, reference.name)
        for reference in references(spec)
        if reference.kind == "tendon" and reference.holder == tendon
    }


def elements_of(limb: mujoco.MjsBody) -> set[Element]:
    """Return all elements of a limb."""
    return {element for body in subtree(limb) for element in own_elements(body)}


def own_elements(body: mujoco.MjsBody) -> set[Element]:
    """Return a body and the elements on it."""
    found = {(_O.mjOBJ_BODY, body.name)}
    for kind, elements in (
        (_O.mjOBJ_JOINT, body.joints),
        (_O.mjOBJ_GEOM, body.geoms),
        (_O.mjOBJ_SITE, body.sites),
        (_O.mjOBJ_CAMERA, body.cameras),
        (_O.mjOBJ_LIGHT, body.lights),
    ):
        found |= {(kind, element.name) for element in elements}
    return found


# --- Elements that change their shape ---------------------------------------------------------


def release_drawings(spec: mujoco.MjSpec, touched: set[Element], *, skins: bool = True) -> None:
    """Remove the skins over bodies that change; they have no physical effect.

    Args:
        spec: Specification that contains them.
        touched: Elements that are reshaped, removed or copied.
        skins: False to keep the skins.

    Raises:
        MorphologyError: If one of the bodies carries a part of a flex.
    """
    found: dict[str, mujoco.MjsSkin] = {}
    for reference in references(spec):
        if (reference.target, reference.name) not in touched:
            continue
        if reference.kind == "flex":
            raise MorphologyError(
                f"{reference.name!r} carries a part of {reference}, which would not follow: "
                "remove the flex first."
            )
        if reference.kind == "skin" and skins:
            found[reference.holder.name] = reference.holder
    for skin in found.values():
        spec.delete(skin)


# --- Elements that go -------------------------------------------------------------------------


def require_unnamed(
    spec: mujoco.MjSpec, element: Element, why: str, kinds: Iterable[str] | None = None
) -> None:
    """Refuse an edit that would leave a reference to an element without its meaning.

    Args:
        spec: Specification that contains it.
        element: The element.
        why: The reason, as the end of a sentence, such as "lies beyond the cut".
        kinds: Kinds of references to refuse; None for all.

    Raises:
        MorphologyError: If anything names the element.
    """
    for reference in references(spec):
        named = (reference.target, reference.name) == element
        if named and (kinds is None or reference.kind in kinds):
            raise MorphologyError(
                f"{name_of(element)} {why}, but {reference} names it: change or remove it first."
            )


def name_of(element: Element) -> str:
    """Return what a message calls an element; the place of a pin has no name of its own."""
    return "A pin" if element[1].startswith(MARK) else repr(element[1])


def remove_limb(spec: mujoco.MjSpec, limb: mujoco.MjsBody) -> None:
    """Remove a limb with all that has no meaning without it.

    Motors, sensors, exclusions, contact pairs, pins and followers go with the limb, and so do the
    tendons that move it alone. Cameras and lights that aim at it aim at the body that carried it.

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.

    Raises:
        MorphologyError: If an element elsewhere would lose what moves it.
    """
    require_removable(spec, limb)
    gone = elements_of(limb)
    release_drawings(spec, gone)
    for aimed in (*spec.cameras, *spec.lights):
        if (_O.mjOBJ_BODY, aimed.targetbody) in gone:
            aimed.targetbody = limb.parent.name
    for group in list(spec.tuples):
        members = zip(group.objtype, group.objname, group.objprm, strict=True)
        kept = [member for member in members if (_plain(_O(member[0])), member[1]) not in gone]
        if not kept:
            spec.delete(group)
        elif len(kept) < len(group.objname):
            kinds, names, values = zip(*kept, strict=True)
            group.objtype, group.objname, group.objprm = list(kinds), list(names), list(values)
    spec.delete(limb)


def require_removable(spec: mujoco.MjSpec, limb: mujoco.MjsBody) -> None:
    """Refuse to remove a limb without which an element elsewhere would lose what moves it.

    Args:
        spec: Specification that contains it.
        limb: First body of the limb.

    Raises:
        MorphologyError: If a tendon, coupling or actuator ties it to what stays.
    """
    gone = elements_of(limb)
    for tendon in spec.tendons:
        crosses = not path_elements(spec, tendon).isdisjoint(gone)
        if crosses and not moves_only(spec, tendon, gone) and does_something(spec, tendon):
            raise MorphologyError(
                f"The tendon {tendon.name!r} also moves what stays when {limb.name!r} is removed: "
                "remove or reroute the tendon first."
            )
        if crosses:
            gone.add((_O.mjOBJ_TENDON, tendon.name))
    for equality in spec.equalities:
        kind = COUPLINGS.get(equality.type)
        if kind and (kind, equality.name2) in gone and (kind, equality.name1) not in gone:
            raise MorphologyError(
                f"{equality.name1!r} follows {equality.name2!r}, which would be removed: lock one "
                "of them first."
            )
    for actuator in spec.actuators:
        if actuator.trntype != _T.mjTRN_SITE or (_O.mjOBJ_SITE, actuator.target) in gone:
            continue
        if (_O.mjOBJ_SITE, actuator.refsite) in gone:
            raise MorphologyError(
                f"The actuator {actuator.name!r} acts relative to {actuator.refsite!r}, which "
                "would be removed."
            )


def moves_only(spec: mujoco.MjSpec, tendon: mujoco.MjsTendon, elements: set[Element]) -> bool:
    """Return whether a tendon moves nothing but a limb.

    Args:
        spec: Specification that contains it.
        tendon: The tendon.
        elements: The elements of the limb.
    """
    staying = path_elements(spec, tendon) - elements
    if any(kind == _O.mjOBJ_JOINT for kind, _ in staying):
        return False
    # All points elsewhere are on bodies that are fixed to each other.
    finders = {_O.mjOBJ_SITE: spec.site, _O.mjOBJ_GEOM: spec.geom}
    return len({_carrier(finders[kind](name).parent).name for kind, name in staying}) < 2


def _carrier(body: mujoco.MjsBody) -> mujoco.MjsBody:
    """Return the nearest body towards the world that has a joint, or the world."""
    while body.parent is not None and not body.joints:
        body = body.parent
    return body


def does_something(spec: mujoco.MjSpec, tendon: mujoco.MjsTendon) -> bool:
    """Return whether a tendon acts or is used; the humanoid's do neither."""
    lower, upper = tendon.range
    automatic = tendon.limited == mujoco.mjtLimited.mjLIMITED_AUTO and lower < upper
    acts = np.any(tendon.stiffness) or np.any(tendon.damping) or tendon.frictionloss
    if tendon.limited == mujoco.mjtLimited.mjLIMITED_TRUE or automatic or acts or tendon.armature:
        return True
    named = {r.name for r in references(spec) if r.target == _O.mjOBJ_TENDON}
    return bool(tendon.name) and tendon.name in named


# --- Joints that are locked -------------------------------------------------------------------

# Two positions of one joint that differ by less are the same, rad or m.
_SAME: Final = 1e-6


def remove_joint(
    spec: mujoco.MjSpec, joint: mujoco.MjsJoint, displacements: Mapping[str, float]
) -> None:
    """Remove a locked joint; what is coupled to it is held where the coupling puts it.

    Its motor and its sensors go with it, and so does a tendon whose joints are all locked.

    Args:
        spec: Specification that contains it.
        joint: The joint.
        displacements: Position relative to the reference, rad or m, of each joint that is being
            locked, this one included.

    Raises:
        MorphologyError: If a tendon ties the joint to others, or a coupling contradicts the lock.
    """
    name = joint.name
    _hold(spec, _E.mjEQ_JOINT, name, displacements[name])
    gone: set[Element] = {(_O.mjOBJ_JOINT, name)}
    for tendon in list(spec.tendons):
        coefficients = {
            wrap.target.name: float(wrap.coef)
            for wrap in path_of(tendon)
            if wrap.type == _W.mjWRAP_JOINT
        }
        if name not in coefficients:
            continue
        if coefficients.keys() <= displacements.keys():
            length = sum(coefficients[j] * displacements[j] for j in coefficients)
            _hold(spec, _E.mjEQ_TENDON, tendon.name, length)
            gone.add((_O.mjOBJ_TENDON, tendon.name))
        elif does_something(spec, tendon):
            raise MorphologyError(
                f"{name!r} is tied to other joints by the tendon {tendon.name!r}, so it cannot "
                "be removed alone."
            )
        spec.delete(tendon)
    for actuator in list(spec.actuators):
        if (_TARGETS.get(actuator.trntype), actuator.target) in gone:
            gone.add((_O.mjOBJ_ACTUATOR, actuator.name))
            spec.delete(actuator)
    for sensor in list(spec.sensors):
        if (sensor.objtype, sensor.objname) in gone:
            spec.delete(sensor)
    spec.delete(joint)


def _hold(spec: mujoco.MjSpec, kind: mujoco.mjtEq, name: str, locked: float) -> None:
    """Hold what is coupled to an element that no longer moves.

    Args:
        spec: Specification that contains it.
        kind: Kind of coupling.
        name: Name of the joint or tendon.
        locked: Its value relative to that of the reference pose, rad or m.
    """
    for equality in [e for e in spec.equalities if e.type == kind]:
        polynomial = np.array(equality.data[:5])
        if equality.name2 == name:
            held = float(np.polynomial.polynomial.polyval(locked, polynomial))
            _set_constant(equality, equality.name1, held)
        elif equality.name1 == name:
            # Of an equality of one element, the constant alone counts.
            slope = polynomial[1] if equality.name2 else 0.0
            if equality.name2 and np.any(polynomial[2:]):
                raise MorphologyError(
                    f"{name!r} follows {equality.name2!r} by a curve, so it cannot be locked: lock "
                    f"{equality.name2!r} instead."
                )
            if slope:
                held = float((locked - polynomial[0]) / slope)
                _set_constant(equality, equality.name2, held)
                continue
            if abs(locked - polynomial[0]) > _SAME:
                raise MorphologyError(
                    f"{name!r} is held {polynomial[0]:.4g} from its reference by a coupling, so it "
                    f"cannot be locked {locked:.4g} from it."
                )
            spec.delete(equality)


def _set_constant(equality: mujoco.MjsEquality, name: str, held: float) -> None:
    """Turn a coupling into one that holds a single element."""
    equality.name1, equality.name2 = name, ""
    data = np.array(equality.data)
    data[:5] = [held, 0.0, 0.0, 0.0, 0.0]
    equality.data = data


# --- Segments that are split ------------------------------------------------------------------


def require_divisible(spec: mujoco.MjSpec, body: mujoco.MjsBody, cut: Iterable[str]) -> None:
    """Refuse to divide what names a whole segment, or a geom that would be cut in two.

    Args:
        spec: Specification that contains it.
        body: The segment.
        cut: Names of its geoms that would be cut in two.

    Raises:
        MorphologyError: If a reference would mean one of the parts only.
    """
    for name in cut:
        require_unnamed(spec, (_O.mjOBJ_GEOM, name), "would be cut in two", ("tendon", "sensor"))
    for reference in references(spec):
        if (reference.target, reference.name) != (_O.mjOBJ_BODY, body.name):
            continue
        holder = reference.holder
        whole = reference.kind == "actuator" or (
            reference.kind == "sensor" and holder.type in _OF_ALL_GEOMS
        )
        if whole:
            raise MorphologyError(
                f"{body.name!r} cannot be split: {reference} is about all of its geoms."
            )
