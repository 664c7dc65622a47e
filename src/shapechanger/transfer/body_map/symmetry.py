"""A symmetry of one body: the same motion, seen in a mirror or from the next leg on."""

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

__all__ = ["Symmetry", "mirror"]


class Symmetry(msgspec.Struct, frozen=True):
    """A permutation of a body's features with a sign for each.

    Attributes:
        observation_layout: What the body senses.
        action_layout: What the body moves.
        observation: For each observation feature, in order, what it takes: the feature that the
            turned body has in its place.
        action: The same for each action feature.

    Raises:
        MapError: If it is no permutation, a scale is not 1 or -1, or two features that change
            places differ in unit, shape or range.
        UnknownName: If a feature is taken that is not there.
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
        """The symmetry in which some features change; the others stay as they are.

        Args:
            observation_layout: What the body senses.
            action_layout: What the body moves.
            observation: For an observation feature what it takes, with scale 1 or -1.
            action: The same for action features.

        Raises:
            MapError: If that is no symmetry.
            UnknownName: If a feature is named that is not there.
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
        """The symmetry that undoes this one; a mirror undoes itself."""
        return Symmetry(
            self.observation_layout,
            self.action_layout,
            _undone(self.observation_layout, self.observation),
            _undone(self.action_layout, self.action),
        )

    def suits(self, observation: Layout, action: Layout) -> bool:
        """Whether the numbers of a body mean what those of this symmetry mean."""
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
                f"{taken[take.feature]!r} and {feature.name!r} both take {take.feature!r}: "
                "a symmetry takes each feature once."
            )
        taken[take.feature] = feature.name
        _check_pair(feature, layout[take.feature], take.scale)


def _check_pair(feature: Feature, partner: Feature, scale: float) -> None:
    """Refuse two features that cannot stand for each other."""
    if abs(scale) != 1.0:
        raise MapError(
            f"{feature.name!r} takes {partner.name!r} times {scale:g}: "
            "in a symmetry the scale is 1 or -1."
        )
    for aspect in ("unit", "shape", "gain", "gain_unit"):
        ours, theirs = getattr(feature, aspect), getattr(partner, aspect)
        if ours != theirs:
            raise MapError(
                f"{feature.name!r} and {partner.name!r} cannot change places: "
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
    """Whether two bounds are one but for rounding, such as that of degrees to radians."""
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
            other = template if template in elements else expand_template(template, glob, element)
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


def _reflected(feature: Feature, partners: Mapping[str, str], flipped: frozenset[str]) -> Copy:
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
    return Copy("/".join((partners.get(element, element), *path)), sign)
