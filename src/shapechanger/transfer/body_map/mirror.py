"""The left-right mirror image of a body, found by the names of its features.

The mirror is the plane y = 0, with x forward and z up. It turns the sign of the y component of a
vector (position, velocity, force) and of the x and z components of an axial vector (angular
velocity, torque). A rotation about the axis n becomes the rotation by the same angle about n with
its y component kept and the others turned, so a quaternion (w, x, y, z) turns x and z. A hinge
whose axis is carried to the axis of its partner keeps its sign, and one whose axis is carried to
the opposite turns it: which those are is for the caller to say.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping
from typing import Final

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map.rules import Take
from shapechanger.transfer.body_map.symmetry import Symmetry
from shapechanger.transfer.body_map.wildcards import filled_in

__all__ = ["mirror"]

# The last part of a feature's name, where it is a component along an axis of the world.
# Of an inertia the products with y turn; the cosine of an angle is that of the opposite.
_TURNED: Final = frozenset({"y", "vy", "fy", "wx", "wz", "tx", "tz", "qx", "qz", "xy", "yz", "my"})
_KEPT: Final = frozenset(
    {"x", "z", "vx", "vz", "fx", "fz", "wy", "ty", "qw", "qy", "xx", "yy", "zz", "xz", "mx", "mz"}
    | {"cos"}
)


def mirror(
    observation_layout: Layout,
    action_layout: Layout,
    *,
    swap: Mapping[str, str] | None = None,
    flip: Iterable[str] = (),
) -> Symmetry:
    """The symmetry that exchanges left and right.

    The element of a feature is what stands before the first "/" of its name.

    Args:
        observation_layout: What the body senses.
        action_layout: What the body moves.
        swap: For an element on one side the one on the other, such as `{"hip_1": "hip_4"}`, or a
            glob, such as `{"*_1": "*_4"}`; each pair is named once or both ways. An element that
            is not named stays where it is.
        flip: Globs of elements whose coordinate changes its sign, such as the hinges about a
            vertical axis; both elements of a pair or neither. Components along axes of the world,
            such as `torso/vy`, need no mention.

    Raises:
        MapError: If the pairs contradict each other, one element of a pair flips and the other
            does not, a feature is a block, or the ranges of a pair are no mirror images.
        UnknownName: If an element or the partner of a feature is not there.
    """
    features = (*observation_layout, *action_layout)
    elements = tuple(dict.fromkeys(_element(feature) for feature in features))
    partners = _both_ways(swap or {}, elements)
    flipped = frozenset(name for glob in flip for name in _fitting(glob, elements))
    for element, partner in partners.items():
        if (element in flipped) != (partner in flipped):
            raise MapError(
                f"{element!r} and {partner!r} mirror each other: flip both of them or neither."
            )
    return Symmetry(
        observation_layout,
        action_layout,
        tuple(_reflected(feature, partners, flipped) for feature in observation_layout),
        tuple(_reflected(feature, partners, flipped) for feature in action_layout),
    )


def _element(feature: Feature) -> str:
    return feature.name.split("/", 1)[0]


def _both_ways(swap: Mapping[str, str], elements: tuple[str, ...]) -> dict[str, str]:
    partners: dict[str, str] = {}
    for glob, template in swap.items():
        for element in _fitting(glob, elements):
            other = template if template in elements else filled_in(template, glob, element)
            for name, partner in ((element, other), (other, element)):
                if name not in elements:
                    raise UnknownName("element", name, elements)
                if partners.setdefault(name, partner) != partner:
                    raise MapError(
                        f"{name!r} is to mirror both {partners[name]!r} and {partner!r}: "
                        "choose one."
                    )
    return partners


def _fitting(glob: str, elements: tuple[str, ...]) -> list[str]:
    """The elements that bear this name or fit this glob."""
    fits = [glob] if glob in elements else [e for e in elements if fnmatch.fnmatchcase(e, glob)]
    if not fits:
        raise UnknownName("element", glob, elements)
    return fits


def _reflected(feature: Feature, partners: Mapping[str, str], flipped: frozenset[str]) -> Take:
    """What the mirrored body has in the place of `feature`."""
    if feature.shape:
        raise MapError(f"{feature.name!r} is a block of numbers, which no mirror turns by name.")
    element, *path = feature.name.split("/", 1)
    component = feature.name.rsplit("/", 1)[-1]
    if component in _KEPT:
        sign = 1.0
    elif component in _TURNED or element in flipped:
        sign = -1.0
    else:
        sign = 1.0
    return Take("/".join((partners.get(element, element), *path)), sign)
