"""Symmetries of one body, such as its left-right mirror image, found by the names of its features.

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

import msgspec

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map.rules import (
    SAME_NAME,
    Copy,
    MapEntry,
    SideName,
    expand_template,
    same_meaning,
)


class Symmetry(msgspec.Struct, frozen=True):
    """A permutation of a body's features with a sign for each.

    Attributes:
        observation_layout: Layout of the body's observations.
        action_layout: Layout of the body's actions.
        observation: For each observation feature, in order, the feature that the transformed body
            has in its place.
        action: The same for each action feature.

    Raises:
        MapError: If it is not a permutation, a scale is not 1 or -1, or two features that swap
            differ in unit, shape or range.
        UnknownName: If a feature does not exist.
    """

    observation_layout: Layout
    action_layout: Layout
    observation: tuple[Copy, ...]
    action: tuple[Copy, ...]

    def __post_init__(self) -> None:
        _check("observation", self.observation_layout, self.observation)
        _check("action", self.action_layout, self.action)

    @classmethod
    def of(
        cls,
        observation_layout: Layout,
        action_layout: Layout,
        *,
        observation: Mapping[str, Copy] | None = None,
        action: Mapping[str, Copy] | None = None,
    ) -> Symmetry:
        """Build the symmetry that changes some features and keeps the others.

        Args:
            observation_layout: Layout of the body's observations.
            action_layout: Layout of the body's actions.
            observation: For an observation feature what it copies, with scale 1 or -1.
            action: The same for action features.

        Raises:
            MapError: If that is not a symmetry.
            UnknownName: If a feature does not exist.
        """
        return cls(
            observation_layout,
            action_layout,
            _completed(observation_layout, observation or {}),
            _completed(action_layout, action or {}),
        )

    @property
    def observation_entries(self) -> tuple[MapEntry, ...]:
        """One entry for each observation feature, as in a body map."""
        return _entries(self.observation_layout, self.observation)

    @property
    def action_entries(self) -> tuple[MapEntry, ...]:
        """One entry for each action feature, as in a body map."""
        return _entries(self.action_layout, self.action)

    def inverse(self) -> Symmetry:
        """Return the inverse symmetry; a mirror is its own inverse."""
        return Symmetry(
            self.observation_layout,
            self.action_layout,
            _undone(self.observation_layout, self.observation),
            _undone(self.action_layout, self.action),
        )

    def fits(self, observation: Layout, action: Layout) -> bool:
        """Return whether the symmetry fits the layouts of a body.

        Args:
            observation: Layout of the body's observations.
            action: Layout of the body's actions.
        """
        return not (
            same_meaning(self.observation_layout, observation)
            or same_meaning(self.action_layout, action)
        )


def _check(side: SideName, layout: Layout, takes: tuple[Copy, ...]) -> None:
    if len(takes) != len(layout):
        raise MapError(
            f"A symmetry needs {len(layout)} {side} rules, one a feature: {len(takes)} given."
        )
    taken: dict[str, str] = {}
    for feature, take in zip(layout, takes, strict=True):
        if take.feature not in layout:
            raise UnknownName(f"{side} feature", take.feature, layout.names)
        if take.feature in taken:
            raise MapError(
                f"{taken[take.feature]!r} and {feature.name!r} both copy {take.feature!r}: "
                "a symmetry copies each feature once."
            )
        taken[take.feature] = feature.name
        _check_pair(feature, layout[take.feature], take.scale)


def _check_pair(feature: Feature, partner: Feature, scale: float) -> None:
    """Refuse two features that cannot swap."""
    if abs(scale) != 1.0:
        raise MapError(
            f"{feature.name!r} copies {partner.name!r} times {scale:g}: "
            "in a symmetry the scale is 1 or -1."
        )
    for aspect in ("unit", "shape", "gain", "gain_unit"):
        ours, theirs = getattr(feature, aspect), getattr(partner, aspect)
        if ours != theirs:
            raise MapError(
                f"{feature.name!r} and {partner.name!r} cannot swap: "
                f"their {aspect} is {ours!r} and {theirs!r}."
            )
    low, high = sorted((scale * partner.low, scale * partner.high))
    if not (_close(low, feature.low) and _close(high, feature.high)):
        raise MapError(
            f"{feature.name!r} reaches from {feature.low:g} to {feature.high:g} and "
            f"{partner.name!r} times {scale:g} from {low:g} to {high:g}: "
            "the body has no such symmetry."
        )


def _close(a: float, b: float) -> bool:
    """Return whether two bounds are equal up to rounding, such as from degrees to radians."""
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12)


def _completed(layout: Layout, changes: Mapping[str, Copy]) -> tuple[Copy, ...]:
    for name in changes:
        if name not in layout:
            raise UnknownName("feature", name, layout.names)
    return tuple(changes.get(name, Copy(name)) for name in layout.names)


def _undone(layout: Layout, takes: tuple[Copy, ...]) -> tuple[Copy, ...]:
    back = {
        take.feature: Copy(name, take.scale) for name, take in zip(layout.names, takes, strict=True)
    }
    return tuple(back[name] for name in layout.names)


def _entries(layout: Layout, takes: tuple[Copy, ...]) -> tuple[MapEntry, ...]:
    return tuple(
        MapEntry(name, take, SAME_NAME if take == Copy(name) else "symmetry")
        for name, take in zip(layout.names, takes, strict=True)
    )


# Last parts of feature names that are components along an axis of the world. The products of
# inertia with y change sign; the cosine of an angle does not.
_NEGATED: Final = frozenset({"y", "vy", "fy", "wx", "wz", "tx", "tz", "qx", "qz", "xy", "yz", "my"})
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
    """Build the symmetry that swaps left and right.

    The element of a feature is the part of its name before the first "/".

    Args:
        observation_layout: Layout of the body's observations.
        action_layout: Layout of the body's actions.
        swap: Partner of each element on the other side, such as `{"hip_1": "hip_4"}`, or of a glob,
            such as `{"*_1": "*_4"}`; each pair appears once or both ways. Other elements stay in
            place.
        flip: Globs of elements whose coordinate changes sign, such as the hinges about a vertical
            axis; both elements of a pair or neither. Components along axes of the world, such as
            `torso/vy`, are recognised by their names.

    Raises:
        MapError: If the pairs contradict each other, one element of a pair flips and the other
            does not, a feature is a block, or the ranges of a pair are no mirror images.
        UnknownName: If an element or the partner of a feature does not exist.
    """
    features = (*observation_layout, *action_layout)
    elements = tuple(dict.fromkeys(_element(feature) for feature in features))
    partners = _both_ways(swap or {}, elements)
    flipped = frozenset(name for glob in flip for name in _fitting(glob, elements))
    for element, partner in partners.items():
        if (element in flipped) != (partner in flipped):
            raise MapError(f"{element!r} and {partner!r} mirror each other: flip both or neither.")
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


def _reflected(feature: Feature, partners: Mapping[str, str], flipped: frozenset[str]) -> Copy:
    """The feature that the mirrored body has instead of `feature`."""
    if feature.shape:
        raise MapError(f"{feature.name!r} is a block of numbers, which cannot be mirrored by name.")
    element, *path = feature.name.split("/", 1)
    component = feature.name.rsplit("/", 1)[-1]
    if component in _KEPT:
        sign = 1.0
    elif component in _NEGATED or element in flipped:
        sign = -1.0
    else:
        sign = 1.0
    return Copy("/".join((partners.get(element, element), *path)), sign)
