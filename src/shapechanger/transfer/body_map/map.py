"""`BodyMap`: the map between the observations and actions of two bodies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import MapError
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map.matching import (
    Units,
    check_patterns,
    constant_rule,
    read_toml,
    resolve,
    write_toml,
)
from shapechanger.transfer.body_map.rules import (
    BY_DEFAULT,
    SAME_NAME,
    Copy,
    Gather,
    MapEntry,
    RuleLike,
    Side,
    SideName,
    Zero,
    check_entries,
    compose_rules,
    describe_rule,
    same_meaning,
)
from shapechanger.transfer.body_map.symmetry import Symmetry, mirror


def _compose_entries(outer: Sequence[MapEntry], inner: Sequence[MapEntry]) -> tuple[MapEntry, ...]:
    """Replace each feature that `outer` copies by its rule in `inner`."""
    filled_by = {entry.feature: entry for entry in inner}
    result: list[MapEntry] = []
    for entry in outer:
        if isinstance(entry.rule, Copy):
            through = filled_by[entry.rule.feature]
            reasons = [why for why in (entry.why, through.why) if why != SAME_NAME]
            rule = compose_rules(entry.rule, through.rule)
            result.append(MapEntry(entry.feature, rule, ", then ".join(reasons) or SAME_NAME))
        else:
            result.append(entry)
    return tuple(result)


def _invert_entries(
    side: Side, entries: Sequence[MapEntry], otherwise: RuleLike
) -> tuple[MapEntry, ...]:
    """Return for each feature of `side.over` a rule over `side.into`."""
    copies: dict[str, list[tuple[MapEntry, float]]] = {}
    for entry in entries:
        if isinstance(entry.rule, Copy):
            copies.setdefault(entry.rule.feature, []).append((entry, entry.rule.scale))
    return tuple(
        _backwards(feature, copies.get(feature.name, []), otherwise) for feature in side.over
    )


def _backwards(
    feature: Feature, copies: list[tuple[MapEntry, float]], otherwise: RuleLike
) -> MapEntry:
    """Recover `feature` from its copies."""
    if not copies:
        return MapEntry(feature.name, constant_rule(otherwise, feature), BY_DEFAULT)
    namesakes = [taker for taker in copies if taker[0].feature == feature.name]
    if len(copies) > 1 and not namesakes:
        names = " and ".join(repr(entry.feature) for entry, _ in copies)
        raise MapError(
            f"{feature.name!r} is copied to {names}, none of which has its name: "
            "the inverse is not unique."
        )
    entry, scale = (namesakes or copies)[0]
    return MapEntry(feature.name, Copy(entry.feature, 1.0 / scale), entry.why)


class MapRow(NamedTuple):
    """One line of `BodyMap.table`."""

    side: SideName
    entry: str
    rule: str
    why: str


class BodyMap(msgspec.Struct, frozen=True, dict=True):
    """Map that lets a policy of a source body act in a target body.

    Each source observation feature is filled from target observation features, and each target
    action feature from source action features. Both halves are affine:

        o_source = M o_target + c        a_target = clip(N a_source + d)

    Attributes:
        source_observation: Layout of the source's observations.
        target_observation: Layout of the target's observations.
        source_action: Layout of the source's actions.
        target_action: Layout of the target's actions.
        observation: One rule for each feature of `source_observation`, in order.
        action: One rule for each feature of `target_action`, in order.

    Raises:
        MapError: If a feature has no rule, or copies a block of another shape.
        UnknownName: If a rule copies a feature that does not exist.
    """

    source_observation: Layout
    target_observation: Layout
    source_action: Layout
    target_action: Layout
    observation: tuple[MapEntry, ...]
    action: tuple[MapEntry, ...]

    def __post_init__(self) -> None:
        check_entries(self._observation_side, self.observation)
        check_entries(self._action_side, self.action)

    @classmethod
    def between(
        cls,
        source_observation: Layout,
        target_observation: Layout,
        source_action: Layout,
        target_action: Layout,
        *,
        rules: Mapping[str, RuleLike] | None = None,
        observation_rules: Mapping[str, RuleLike] | None = None,
        action_rules: Mapping[str, RuleLike] | None = None,
        otherwise: RuleLike = Zero(),  # noqa: B008 - frozen, so sharing it is safe.
        units: Units = "same",
    ) -> BodyMap:
        """Match the features of two bodies by name.

        A rule under the exact name of a feature takes precedence, then the partner of the same
        name, then the first glob that matches, then `otherwise`.

        Args:
            source_observation: Layout of the source's observations.
            target_observation: Layout of the target's observations.
            source_action: Layout of the source's actions.
            target_action: Layout of the target's actions.
            rules: Rules, keyed by the name or glob of source observation and target action
                features. A rule is a `Copy`, `Zero`, `Hold` or `Learn`, or one of "zero", "hold"
                (the middle of the range), "learn" and "copy NAME"; stars in NAME stand for what the
                wildcards of the glob matched, as in `{"foot_*/motor": "copy ankle_*/motor"}`.
            observation_rules: Rules of source observation features only; they take precedence.
            action_rules: Rules of target action features only; they take precedence.
            otherwise: The rule of features that nothing matches.
            units: "same" passes action numbers on unchanged. "torque" scales them by source gain
                over target gain, so that they give the same torque as in the source. "exact" uses
                each scale and constant as given, without a check of units and ranges.

        Raises:
            MapError: If a partner has another unit or shape, if a rule changes nothing, or if no
                name occurs in both bodies.
            UnknownName: If a rule matches no feature, or copies one that does not exist.
        """
        shared = dict(rules or {})
        on_observation, on_action = dict(observation_rules or {}), dict(action_rules or {})
        sensed = Side("observation", source_observation, target_observation)
        moved = Side("action", target_action, source_action)
        # Special rules come first and are not overridden.
        observation = resolve(sensed, on_observation | shared | on_observation, otherwise, units)
        action = resolve(moved, on_action | shared | on_action, otherwise, units)
        check_patterns(shared, [(sensed, observation), (moved, action)])
        check_patterns(on_observation, [(sensed, observation)])
        check_patterns(on_action, [(moved, action)])
        return cls(
            source_observation=source_observation,
            target_observation=target_observation,
            source_action=source_action,
            target_action=target_action,
            observation=observation,
            action=action,
        )

    @classmethod
    def identity(cls, observation: Layout, action: Layout) -> BodyMap:
        """Return the identity map of a body.

        Args:
            observation: Layout of its observations.
            action: Layout of its actions.
        """
        return cls(
            source_observation=observation,
            target_observation=observation,
            source_action=action,
            target_action=action,
            observation=tuple(MapEntry(name, Copy(name), SAME_NAME) for name in observation.names),
            action=tuple(MapEntry(name, Copy(name), SAME_NAME) for name in action.names),
        )

    def adapt_observation(self, target_observation: ArrayLike) -> NDArray[Any]:
        """Return the observation of the source body.

        Args:
            target_observation: Shape (..., target_observation.size).

        Returns:
            Shape (..., source_observation.size): float32 for float32, float64 for float64.

        Raises:
            SpaceMismatch: If the last axis has another length.
        """
        return self._observation_gather(target_observation)

    def adapt_action(self, source_action: ArrayLike) -> NDArray[Any]:
        """Return the action of the target body, clipped to its bounds.

        Args:
            source_action: Shape (..., source_action.size).

        Returns:
            Shape (..., target_action.size): float32 for float32, float64 for float64.

        Raises:
            SpaceMismatch: If the last axis has another length.
        """
        action = self._action_gather(source_action)
        low, high = self._action_bounds
        return np.clip(action, low.astype(action.dtype), high.astype(action.dtype))

    @cached_property
    def observation_matrix(self) -> NDArray[np.float64]:
        """M, shape (source_observation.size, target_observation.size); read-only."""
        return self._observation_gather.matrix()

    @property
    def observation_offset(self) -> NDArray[np.float64]:
        """c, shape (source_observation.size,); read-only."""
        return self._observation_gather.offset

    @cached_property
    def action_matrix(self) -> NDArray[np.float64]:
        """N, shape (target_action.size, source_action.size); read-only."""
        return self._action_gather.matrix()

    @property
    def action_offset(self) -> NDArray[np.float64]:
        """d, shape (target_action.size,); read-only."""
        return self._action_gather.offset

    def then(self, following: BodyMap) -> BodyMap:
        """Compose: the map from this source to the target of `following`.

        The action bounds of the body in the middle no longer apply.

        Args:
            following: A map whose source is the target of this one.

        Raises:
            MapError: If the target of this map and the source of `following` mean different things.
        """
        self._check_meeting("observation", self.target_observation, following.source_observation)
        self._check_meeting("action", self.target_action, following.source_action)
        return BodyMap(
            source_observation=self.source_observation,
            target_observation=following.target_observation,
            source_action=self.source_action,
            target_action=following.target_action,
            observation=_compose_entries(self.observation, following.observation),
            action=_compose_entries(following.action, self.action),
        )

    def inverse(self, otherwise: RuleLike = Zero()) -> BodyMap:  # noqa: B008 - frozen.
        """Invert: the map from this target back to this source.

        A feature that was copied several times is recovered from the copy of the same name.

        Args:
            otherwise: The rule of a feature that was not copied: zero, hold or learn.

        Raises:
            MapError: If a feature was copied several times, but not under its own name.
        """
        return BodyMap(
            source_observation=self.target_observation,
            target_observation=self.source_observation,
            source_action=self.target_action,
            target_action=self.source_action,
            observation=_invert_entries(self._observation_side, self.observation, otherwise),
            action=_invert_entries(self._action_side, self.action, otherwise),
        )

    def with_symmetry(self, symmetry: Symmetry) -> BodyMap:
        """Return the map through a symmetry of the source or the target, such as its mirror image.

        A policy of the source then acts as its mirror image. A symmetry that fits both bodies is
        applied to the source.

        Args:
            symmetry: The symmetry.

        Raises:
            MapError: If the symmetry belongs to neither body.
        """
        if symmetry.fits(self.source_observation, self.source_action):
            return _symmetry_map(symmetry, self.source_observation, self.source_action).then(self)
        if symmetry.fits(self.target_observation, self.target_action):
            return self.then(_symmetry_map(symmetry, self.target_observation, self.target_action))
        where = same_meaning(symmetry.observation_layout, self.source_observation) or same_meaning(
            symmetry.action_layout, self.source_action
        )
        raise MapError(
            "The symmetry belongs neither to the source nor to the target: "
            f"between it and the source {where}."
        )

    def table(self) -> tuple[MapRow, ...]:
        """List each feature that is filled, its rule as text, and the origin of the rule."""
        sides: tuple[tuple[SideName, tuple[MapEntry, ...]], ...] = (
            ("observation", self.observation),
            ("action", self.action),
        )
        return tuple(
            MapRow(name, entry.feature, describe_rule(entry.rule), entry.why)
            for name, entries in sides
            for entry in entries
        )

    def __str__(self) -> str:
        """Format the table, one line for each feature."""
        rows = [MapRow._fields, *self.table()]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in rows
        )

    def __repr__(self) -> str:
        """Count the rules by kind."""
        return (
            f"BodyMap(observation: {_counted(self.observation)}; action: {_counted(self.action)})"
        )

    def to_json(self) -> str:
        """Write the map with its four layouts as JSON."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> BodyMap:
        """Read what `to_json` wrote.

        Raises:
            MapError: If the text is not a body map.
        """
        try:
            return msgspec.json.decode(text, type=cls)
        except msgspec.MsgspecError as error:
            raise MapError(f"This is not a body map: {error}.") from error

    def to_toml(self) -> str:
        """Write the rules as TOML, without the layouts, for editing by hand."""
        halves = (self._observation_side, self.observation), (self._action_side, self.action)
        return write_toml(halves)

    @classmethod
    def from_toml(
        cls,
        text: str,
        source_observation: Layout,
        target_observation: Layout,
        source_action: Layout,
        target_action: Layout,
    ) -> BodyMap:
        """Build a map from rules in TOML; see `shapechanger.transfer.body_map.matching`.

        Args:
            text: The rules.
            source_observation: Layout of the source's observations.
            target_observation: Layout of the target's observations.
            source_action: Layout of the source's actions.
            target_action: Layout of the target's actions.

        Raises:
            MapError: If the text is not TOML, or a rule does not fit.
            UnknownName: If a rule matches no feature, or copies one that does not exist.
        """
        wanted = read_toml(text)
        built = cls.between(
            source_observation,
            target_observation,
            source_action,
            target_action,
            observation_rules=wanted.observation,
            action_rules=wanted.action,
            otherwise=wanted.otherwise,
            units=wanted.units,
        )
        if wanted.symmetry is None:
            return built
        of_source = wanted.symmetry.of == "source"
        observation = source_observation if of_source else target_observation
        action = source_action if of_source else target_action
        symmetry = mirror(observation, action, swap=wanted.symmetry.swap, flip=wanted.symmetry.flip)
        turned = _symmetry_map(symmetry, observation, action)
        return turned.then(built) if of_source else built.then(turned)

    @property
    def _observation_side(self) -> Side:
        return Side("observation", self.source_observation, self.target_observation)

    @property
    def _action_side(self) -> Side:
        return Side("action", self.target_action, self.source_action)

    @cached_property
    def _observation_gather(self) -> Gather:
        return Gather.of(self._observation_side, self.observation)

    @cached_property
    def _action_gather(self) -> Gather:
        return Gather.of(self._action_side, self.action)

    @cached_property
    def _action_bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.target_action.low, self.target_action.high

    @staticmethod
    def _check_meeting(name: SideName, first: Layout, second: Layout) -> None:
        where = same_meaning(first, second)
        if where:
            raise MapError(
                f"These maps cannot be composed: between the target {name} of the first and the "
                f"source {name} of the second, {where}."
            )


def _symmetry_map(symmetry: Symmetry, observation: Layout, action: Layout) -> BodyMap:
    """Return a symmetry g as a map from a body to itself: the policy p acts as g⁻¹ p(g o)."""
    return BodyMap(
        source_observation=observation,
        target_observation=observation,
        source_action=action,
        target_action=action,
        observation=symmetry.observation_entries,
        action=symmetry.inverse().action_entries,
    )


def _counted(entries: tuple[MapEntry, ...]) -> str:
    counts = Counter(type(entry.rule).__name__ for entry in entries)
    return ", ".join(f"{number} {kind}" for kind, number in counts.items()) or "none"
