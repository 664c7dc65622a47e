"""A symmetry of one body: the same motion, seen in a mirror or from the next leg on."""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map.entries import SAME_NAME, Entry, SideName, same_meaning
from shapechanger.transfer.body_map.rules import Take

__all__ = ["Symmetry"]


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
    observation: tuple[Take, ...]
    action: tuple[Take, ...]

    def __post_init__(self) -> None:
        _check("observation", self.observation_layout, self.observation)
        _check("action", self.action_layout, self.action)

    @classmethod
    def of(
        cls,
        observation_layout: Layout,
        action_layout: Layout,
        *,
        observation: Mapping[str, Take] | None = None,
        action: Mapping[str, Take] | None = None,
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
    def observation_entries(self) -> tuple[Entry, ...]:
        """One entry for each observation feature, as in a body map."""
        return _entries(self.observation_layout, self.observation)

    @property
    def action_entries(self) -> tuple[Entry, ...]:
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


def _check(side: SideName, layout: Layout, takes: tuple[Take, ...]) -> None:
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


def _completed(layout: Layout, changes: Mapping[str, Take]) -> tuple[Take, ...]:
    for name in changes:
        if name not in layout:
            raise UnknownName("feature", name, layout.names)
    return tuple(changes.get(name, Take(name)) for name in layout.names)


def _undone(layout: Layout, takes: tuple[Take, ...]) -> tuple[Take, ...]:
    back = {
        take.feature: Take(name, take.scale) for name, take in zip(layout.names, takes, strict=True)
    }
    return tuple(back[name] for name in layout.names)


def _entries(layout: Layout, takes: tuple[Take, ...]) -> tuple[Entry, ...]:
    return tuple(
        Entry(name, take, SAME_NAME if take == Take(name) else "symmetry")
        for name, take in zip(layout.names, takes, strict=True)
    )
