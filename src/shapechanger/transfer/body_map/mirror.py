"""The left-right mirror image of a body, found by the names of its features.

The mirror is the plane y = 0, with x forward and z up. It changes the sign of the y component of a
vector (position, velocity, force) and of the x and z components of an axial vector (angular
velocity, torque). A rotation about the axis n becomes the rotation by the same angle about n with
its y component kept and the others negated, so a quaternion (w, x, y, z) negates x and z. A hinge
whose axis is mapped to the axis of its partner keeps its sign, and one whose axis is mapped to the
opposite changes it: the caller states which those are.
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Iterable, Mapping
from typing import Final

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map.rules import SAME_NAME, Copy, MapEntry, expand_template

# Last parts of feature names that are components along an axis of the world. The products of
# inertia with y change sign; the cosine of an angle does not.
_NEGATED: Final = frozenset({"y", "vy", "fy", "wx", "wz", "tx", "tz", "qx", "qz", "xy", "yz", "my"})
_KEPT: Final = frozenset(
    {"x", "z", "vx", "vz", "fx", "fz", "wy", "ty", "qw", "qy", "xx", "yy", "zz", "xz", "mx", "mz"}
    | {"cos"}
)


def mirrored_entries(
    observation: Layout, action: Layout, swap: Mapping[str, str], flip: Iterable[str]
) -> tuple[tuple[MapEntry, ...], tuple[MapEntry, ...]]:
    """Return the entries of a body's mirror image, which is its own inverse: `BodyMap.mirror`."""
    elements = tuple(dict.fromkeys(_element(feature) for feature in (*observation, *action)))
    partners = _both_ways(swap, elements)
    flipped = frozenset(name for glob in flip for name in _fitting(glob, elements))
    for element, partner in partners.items():
        if (element in flipped) != (partner in flipped):
            raise MapError(f"{element!r} and {partner!r} mirror each other: flip both or neither.")
    return (
        tuple(_reflected(feature, observation, partners, flipped) for feature in observation),
        tuple(_reflected(feature, action, partners, flipped) for feature in action),
    )


def _element(feature: Feature) -> str:
    return feature.name.split("/", 1)[0]


def _both_ways(swap: Mapping[str, str], elements: tuple[str, ...]) -> dict[str, str]:
    partners: dict[str, str] = {}
    for glob, template in swap.items():
        for element in _fitting(glob, elements):
            other = template if template in elements else expand_template(template, glob, element)
            for name, partner in ((element, other), (other, element)):
                if name not in elements:
                    raise UnknownName("element", name, elements)
                if partners.setdefault(name, partner) != partner:
                    raise MapError(
                        f"{name!r} cannot mirror both {partners[name]!r} and {partner!r}: "
                        "choose one."
                    )
    return partners


def _fitting(glob: str, elements: tuple[str, ...]) -> list[str]:
    """The element of this exact name, or else the elements that match it as a glob."""
    fits = [glob] if glob in elements else [e for e in elements if fnmatch.fnmatchcase(e, glob)]
    if not fits:
        raise UnknownName("element", glob, elements)
    return fits


def _reflected(
    feature: Feature, layout: Layout, partners: Mapping[str, str], flipped: frozenset[str]
) -> MapEntry:
    """Return the entry that fills a feature of the mirrored body."""
    if feature.shape:
        raise MapError(f"{feature.name!r} is a block of numbers, which cannot be mirrored by name.")
    element, *path = feature.name.split("/", 1)
    component = feature.name.rsplit("/", 1)[-1]
    negated = component in _NEGATED or (component not in _KEPT and element in flipped)
    take = Copy("/".join((partners.get(element, element), *path)), -1.0 if negated else 1.0)
    if take.feature not in layout:
        raise UnknownName("feature", take.feature, layout.names)
    _check_pair(feature, layout[take.feature], take.scale)
    return MapEntry(feature.name, take, SAME_NAME if take == Copy(feature.name) else "symmetry")


def _check_pair(feature: Feature, partner: Feature, scale: float) -> None:
    """Refuse two features that cannot swap."""
    for aspect in ("unit", "shape", "gain", "gain_unit"):
        ours, theirs = getattr(feature, aspect), getattr(partner, aspect)
        if ours != theirs:
            raise MapError(
                f"{feature.name!r} and {partner.name!r} cannot swap: "
                f"their {aspect} is {ours!r} and {theirs!r}."
            )
    low, high = sorted((scale * partner.low, scale * partner.high))
    # Up to rounding, such as from degrees to radians.
    if not all(
        math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12)
        for a, b in ((low, feature.low), (high, feature.high))
    ):
        raise MapError(
            f"{feature.name!r} reaches from {feature.low:g} to {feature.high:g} and "
            f"{partner.name!r} times {scale:g} from {low:g} to {high:g}: "
            "the body has no such symmetry."
        )
