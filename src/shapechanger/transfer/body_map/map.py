"""`BodyMap`: the map between the observations and actions of two bodies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, cast

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import MapError
from shapechanger.layout import Layout
from shapechanger.transfer.body_map.matching import (
    Units,
    check_patterns,
    constant_rule,
    mirrored_entries,
    read_toml,
    resolve,
)
from shapechanger.transfer.body_map.rules import (
    BY_DEFAULT,
    SAME_NAME,
    Copy,
    Half,
    MapEntry,
    RuleLike,
    Side,
    SideName,
    Zero,
    compose_rules,
    describe_rule,
    difference_in_meaning,
)


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


def _invert_entries(half: Half, otherwise: RuleLike) -> tuple[MapEntry, ...]:
    """Return the rule that recovers each feature of `side.over`; `otherwise` without a copy."""
    result: list[MapEntry] = []
    for feature in half.side.over:
        name = feature.name
        takers = {
            entry.feature: (entry.rule.scale, entry.why)
            for entry in half.entries
            if isinstance(entry.rule, Copy) and entry.rule.feature == name
        }
        if not takers:
            result.append(MapEntry(name, constant_rule(otherwise, feature), BY_DEFAULT))
            continue
        if len(takers) > 1 and name not in takers:
            raise MapError(
                f"{name!r} is copied to {' and '.join(map(repr, takers))}, and none of them is "
                f"named {name!r}: the inverse is not unique."
            )
        taker = name if name in takers else next(iter(takers))
        scale, why = takers[taker]
        result.append(MapEntry(name, Copy(taker, 1.0 / scale), why))
    return tuple(result)


class MapRow(NamedTuple):
    """One line of `BodyMap.table`."""

    side: SideName
    entry: str
    rule: str
    why: str


class BodyMap(msgspec.Struct, frozen=True, dict=True):
    """Map that lets a policy of a source body act in a target body.

    Each source observation feature is a constant or a scaled copy of a target observation feature,
    and each target action feature is a constant or a scaled copy of a source action feature:

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
        _ = self._halves

    @property
    def layouts(self) -> tuple[Layout, Layout, Layout, Layout]:
        """The four layouts, in the order of `between`."""
        return (
            self.source_observation,
            self.target_observation,
            self.source_action,
            self.target_action,
        )

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

        A feature gets the first of these rules that exists: the rule under its exact name; a copy
        of the feature of the same name; the first glob that matches; `otherwise`.

        Args:
            source_observation: Layout of the source's observations.
            target_observation: Layout of the target's observations.
            source_action: Layout of the source's actions.
            target_action: Layout of the target's actions.
            rules: Rules, keyed by the name or glob of source observation and target action
                features. A rule is a `Copy`, `Zero`, `Hold` or `Learn`, or one of "zero", "hold"
                (the middle of the range), "learn" and "copy NAME"; stars in NAME are replaced by
                the text that the glob's wildcards match, such as
                `{"foot_*/motor": "copy ankle_*/motor"}`.
            observation_rules: More rules of source observation features, which precede `rules`.
            action_rules: More rules of target action features, which precede `rules`.
            otherwise: The rule of features that no name and no glob matches.
            units: "same" adds no factor to copied numbers. "torque" multiplies actions of known
                gain by source gain divided by target gain, for the same torque as in the source.
                "exact" adds no factor, and does not check units, nor the range of a rule's `Hold`.

        Raises:
            MapError: If a copy has another shape, or another unit and a scale of 1 or -1; if a rule
                is wrong or changes nothing; or if no feature is copied and a feature has no rule.
            UnknownName: If a rule matches no feature, or copies one that does not exist.
        """
        shared = dict(rules or {})
        on_observation, on_action = dict(observation_rules or {}), dict(action_rules or {})
        sensed = Side("observation", source_observation, target_observation)
        moved = Side("action", target_action, source_action)
        # The rules of one side come first, and keep their values if `rules` has the same keys.
        observation = resolve(sensed, on_observation | shared | on_observation, otherwise, units)
        action = resolve(moved, on_action | shared | on_action, otherwise, units)
        check_patterns(shared, [(sensed, observation), (moved, action)])
        check_patterns(on_observation, [(sensed, observation)])
        check_patterns(on_action, [(moved, action)])
        layouts = source_observation, target_observation, source_action, target_action
        return cls(*layouts, observation, action)

    @classmethod
    def identity(cls, observation: Layout, action: Layout) -> BodyMap:
        """Return the identity map of a body.

        Args:
            observation: Layout of the body's observations.
            action: Layout of the body's actions.
        """
        entries = (
            tuple(MapEntry(name, Copy(name), SAME_NAME) for name in layout.names)
            for layout in (observation, action)
        )
        return cls(observation, observation, action, action, *entries)

    @classmethod
    def mirror(
        cls,
        observation: Layout,
        action: Layout,
        *,
        swap: Mapping[str, str] | None = None,
        flip: Iterable[str] = (),
    ) -> BodyMap:
        """Return the map of a body to its mirror image, which swaps left and right.

        The map is its own inverse. Composed with another map (`mirror.then(map)`), it makes a
        policy of the source act as its mirror image. The element of a feature is the part of its
        name before the first "/".

        Args:
            observation: Layout of the body's observations.
            action: Layout of the body's actions.
            swap: Partner of each element on the other side, such as `{"hip_1": "hip_4"}`, or of a
                glob, such as `{"*_1": "*_4"}`; each pair appears once or both ways. Other elements
                stay in place.
            flip: Globs of elements whose coordinate changes sign, such as hinges about a vertical
                axis; they match both elements of a pair or neither. Components along axes of the
                world, such as `torso/vy`, are recognised by their names.

        Raises:
            MapError: If the pairs contradict each other, only one element of a pair flips, a
                feature is a block, or two features that swap differ in unit, shape or gain or do
                not have mirrored ranges.
            UnknownName: If an element or the partner of a feature does not exist.
        """
        entries = mirrored_entries(observation, action, swap or {}, flip)
        return cls(observation, observation, action, action, *entries)

    def adapt_observation(self, target_observation: ArrayLike) -> NDArray[Any]:
        """Return the observation of the source body.

        Args:
            target_observation: Shape (..., target_observation.size).

        Returns:
            Shape (..., source_observation.size): float32 for float32, float64 for float64.

        Raises:
            SpaceMismatch: If the last axis has another length.
        """
        return self._halves[0](target_observation)

    def adapt_action(self, source_action: ArrayLike) -> NDArray[Any]:
        """Return the action of the target body, clipped to its bounds.

        Args:
            source_action: Shape (..., source_action.size).

        Returns:
            Shape (..., target_action.size): float32 for float32, float64 for float64.

        Raises:
            SpaceMismatch: If the last axis has another length.
        """
        action = self._halves[1](source_action)
        low, high = (end.astype(action.dtype) for end in self._action_bounds)
        return np.clip(action, low, high)

    @property
    def observation_matrix(self) -> NDArray[np.float64]:
        """M, shape (source_observation.size, target_observation.size); read-only."""
        return self._halves[0].matrix

    @property
    def observation_offset(self) -> NDArray[np.float64]:
        """c, shape (source_observation.size,); read-only."""
        return self._halves[0].offset

    @property
    def action_matrix(self) -> NDArray[np.float64]:
        """N, shape (target_action.size, source_action.size); read-only."""
        return self._halves[1].matrix

    @property
    def action_offset(self) -> NDArray[np.float64]:
        """d, shape (target_action.size,); read-only."""
        return self._halves[1].offset

    def then(self, following: BodyMap) -> BodyMap:
        """Return the map from this map's source to the target of `following`.

        The action bounds of the intermediate body no longer apply.

        Args:
            following: A map whose source is the target of this one.

        Raises:
            MapError: If the layouts of this map's target and of the source of `following` differ in
                names, order, units, shapes or gains.
        """
        for name, first, second in (
            ("observation", self.target_observation, following.source_observation),
            ("action", self.target_action, following.source_action),
        ):
            if where := difference_in_meaning(first, second):
                raise MapError(
                    f"These maps cannot be composed: between the target {name} of the first and "
                    f"the source {name} of the second, {where}."
                )
        return BodyMap(
            self.source_observation,
            following.target_observation,
            self.source_action,
            following.target_action,
            _compose_entries(self.observation, following.observation),
            _compose_entries(following.action, self.action),
        )

    def inverse(self, otherwise: RuleLike = Zero()) -> BodyMap:  # noqa: B008 - frozen.
        """Return the map from this map's target back to its source.

        A feature that is copied several times is recovered from the copy of the same name.

        Args:
            otherwise: The rule of a feature that is not copied: zero, hold or learn.

        Raises:
            MapError: If a feature is copied several times, but not to a feature of the same name.
        """
        seen, sees, acted, acts = self.layouts
        entries = (_invert_entries(half, otherwise) for half in self._halves)
        return BodyMap(sees, seen, acts, acted, *entries)

    def table(self) -> tuple[MapRow, ...]:
        """Return each filled feature with its rule as text and the origin of the rule."""
        return tuple(
            MapRow(half.side.name, entry.feature, describe_rule(entry.rule), entry.why)
            for half in self._halves
            for entry in half.entries
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
        """Return the number of rules of each kind."""
        sides = ([type(e.rule).__name__ for e in side] for side in (self.observation, self.action))
        return "BodyMap(observation: {}; action: {})".format(*(dict(Counter(s)) for s in sides))

    def to_json(self) -> str:
        """Write the map with its four layouts as JSON."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> BodyMap:
        """Read a map from the JSON of `to_json`.

        Raises:
            MapError: If the text is not a body map.
        """
        try:
            return msgspec.json.decode(text, type=cls)
        except msgspec.MsgspecError as error:
            raise MapError(f"This is not a body map: {error}.") from error

    @classmethod
    def from_toml(cls, text: str, *layouts: Layout) -> BodyMap:
        """Build a map from rules in TOML; see `shapechanger.transfer.body_map.matching`.

        Args:
            text: The rules.
            *layouts: The four layouts of `between`, in its order.

        Raises:
            MapError: If the text is not TOML, or a rule does not fit.
            UnknownName: If a rule matches no feature, or copies one that does not exist.
        """
        wanted = read_toml(text)
        built = cls.between(
            *layouts,
            observation_rules=wanted.observation,
            action_rules=wanted.action,
            otherwise=wanted.otherwise,
            units=cast("Units", wanted.units),
        )
        if wanted.symmetry is None:
            return built
        of_source = wanted.symmetry.of == "source"
        observation, action = layouts[::2] if of_source else layouts[1::2]
        swap, flip = wanted.symmetry.swap, wanted.symmetry.flip
        image = cls.mirror(observation, action, swap=swap, flip=flip)
        return image.then(built) if of_source else built.then(image)

    @cached_property
    def _halves(self) -> tuple[Half, Half]:
        sensed = Side("observation", self.source_observation, self.target_observation)
        moved = Side("action", self.target_action, self.source_action)
        return Half(sensed, self.observation), Half(moved, self.action)

    @cached_property
    def _action_bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.target_action.low, self.target_action.high
