"""Resolve the rules of a body map: by exact name, same name, pattern or default; and as TOML.

The TOML form:

    units = "same"                      # or "torque" or "exact"
    otherwise = "zero"                  # or "hold", "learn", { hold = 0.6 }

    [observation]                       # source observation features, or globs of them
    "foot_*/angle" = { hold = 0.6 }     # or "hold": the middle of the range

    [action]                            # target action features, or globs of them
    "foot_1/motor" = { take = "ankle_1/motor", scale = 0.5 }
    "foot_2/motor" = "learn"
    "foot_[34]/motor" = "copy ankle_*/motor"

    [symmetry]                          # the map of the mirror image
    of = "source"                       # or "target"
    swap = { "*_1" = "*_4", front_left_leg = "right_back_leg" }
    flip = ["hip_*"]

Each part may be left out. Features with the same name in both bodies need no line.
"""

from __future__ import annotations

import fnmatch
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, TypeVar, get_args

import msgspec

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature
from shapechanger.transfer.body_map.rules import (
    BY_DEFAULT,
    SAME_NAME,
    Copy,
    Hold,
    Learn,
    MapEntry,
    Rule,
    RuleLike,
    Side,
    Zero,
    expand_template,
)

Units = Literal["same", "torque", "exact"]
"""Treatment of scales and constants, see `BodyMap.between`."""

_COPY: Final = "copy "
_WORDS: Final = ("zero", "hold", "learn", "copy NAME")
_MOST_NAMES_LISTED: Final = 8
_SPELLED: Final[dict[str, Rule]] = {"zero": Zero(), "learn": Learn()}


def resolve(
    side: Side, rules: Mapping[str, RuleLike], otherwise: RuleLike, units: Units
) -> tuple[MapEntry, ...]:
    """Resolve the rule of each feature of `side.into`."""
    entries: list[MapEntry] = []
    for feature in side.into:
        name = feature.name
        fitting = [name] if name in rules else [p for p in rules if _matches(p, name, side)]
        if name in side.over and name not in rules:
            rule, why = Copy(name), SAME_NAME
        elif fitting:
            rule = _read(rules[fitting[0]], fitting[0], feature, side, units)
            why = _by_rule(fitting[0])
        else:
            rule, why = constant_rule(otherwise, feature), BY_DEFAULT
        entries.append(MapEntry(name, _suited(rule, feature, side, units), why))
    _require_match(side, entries)
    return tuple(entries)


def _matches(pattern: str, name: str, side: Side) -> bool:
    """Return whether a pattern is the name of a feature, or a glob that matches it."""
    return pattern == name or (pattern not in side.into and fnmatch.fnmatchcase(name, pattern))


def _by_rule(pattern: str) -> str:
    """The reason of an entry that has its rule from a pattern."""
    return f"rule {pattern!r}"


def check_patterns(
    patterns: Iterable[str], halves: Sequence[tuple[Side, tuple[MapEntry, ...]]]
) -> None:
    """Check that each pattern gave at least one feature its rule."""
    reasons = {entry.why for _, entries in halves for entry in entries}
    for pattern in patterns:
        if _by_rule(pattern) in reasons:
            continue
        names = [(name, side) for side, _ in halves for name in side.into.names]
        if not any(_matches(pattern, name, side) for name, side in names):
            kind = " or ".join(side.into_kind for side, _ in halves)
            raise UnknownName(kind, pattern, [name for name, _ in names])
        raise MapError(
            f"The rule {pattern!r} changes nothing: each feature that it matches has a partner "
            "of the same name or an earlier rule; name a feature exactly to override that."
        )


def constant_rule(like: RuleLike, feature: Feature) -> Rule:
    """Read a rule that copies nothing, for a remaining feature."""
    match like:
        case "hold":
            return Hold(feature.middle)
        case "zero" | "learn":
            return _SPELLED[like]
        case Hold(value) if not feature.low <= value <= feature.high:
            raise MapError(
                f"{feature.name!r} cannot hold {value:g}: "
                f"it reaches from {feature.low:g} to {feature.high:g} {feature.unit}."
            )
        case Zero() | Hold() | Learn():
            return like
        case _:
            raise MapError(
                f"The rule of the remaining features is 'zero', 'hold' or 'learn', not {like!r}."
            )


def _read(like: RuleLike, pattern: str, feature: Feature, side: Side, units: Units) -> Rule:
    """Read the rule of `pattern` for `feature`."""
    match like:
        case Copy(name, scale):
            pass
        case Hold() if units == "exact":
            return like
        case Zero() | Hold() | Learn() | "hold" | "zero" | "learn":
            return constant_rule(like, feature)
        case str() if like.startswith(_COPY):
            name, scale = like.removeprefix(_COPY).strip(), 1.0
        case str():
            raise MapError(f"{feature.name}: {UnknownName('rule', like, _WORDS)}")
        case _:
            raise MapError(
                f"The rule {pattern!r} is {like!r}: give 'zero', 'hold', 'learn', 'copy NAME', "
                "or a Copy, Zero, Hold or Learn of shapechanger.transfer.body_map."
            )
    return Copy(name if name in side.over else expand_template(name, pattern, feature.name), scale)


def _suited(rule: Rule, feature: Feature, side: Side, units: Units) -> Rule:
    """Return the rule with its scale in the requested units, if it fits the feature."""
    if not isinstance(rule, Copy):
        return rule
    copied, factor = side.copied(rule.feature), 1.0
    if units == "torque" and side.name == "action":
        if copied.gain_unit != feature.gain_unit:
            raise MapError(
                f"One unit of {copied.name!r} gives {copied.gain:g} "
                f"{copied.gain_unit or '(unknown)'} and one of {feature.name!r} {feature.gain:g} "
                f"{feature.gain_unit or '(unknown)'}: units='torque' cannot make them equal; "
                "use units='same'."
            )
        if copied.gain_unit:
            factor, units = copied.gain / feature.gain, "exact"
    if units != "exact" and copied.unit != feature.unit and abs(rule.scale) == 1.0:
        raise MapError(
            f"The {side.into_kind} {feature} cannot copy the {side.over_kind} {copied}, because "
            f"the units differ: give {feature.name!r} a rule with the scale that converts them."
        )
    return Copy(rule.feature, rule.scale * factor)


def _require_match(side: Side, entries: Sequence[MapEntry]) -> None:
    """Refuse a side on which nothing matches and not every feature has an explicit rule."""
    if any(isinstance(e.rule, Copy) for e in entries) or all(e.why != BY_DEFAULT for e in entries):
        return
    into, over = side.into.names, side.over.names
    example = f"copy {over[0]}" if over else "hold"
    raise MapError(
        f"These {side.name} spaces cannot be mapped, because no name occurs in both: the "
        f"{side.into_kind}s are {_listed(into)}; the {side.over_kind}s are {_listed(over)}. "
        f"Write a rule for each, such as rules={{{into[0]!r}: {example!r}}}."
    )


def _listed(names: tuple[str, ...]) -> str:
    """Join the first names."""
    more = len(names) - _MOST_NAMES_LISTED
    shown = ", ".join(names[:_MOST_NAMES_LISTED]) or "none"
    return f"{shown} and {more} more" if more > 0 else shown


_Read = TypeVar("_Read")


class MirrorText(msgspec.Struct):
    """The mirror image of a map in TOML."""

    of: str = "source"
    swap: dict[str, str] = {}
    flip: tuple[str, ...] = ()


class MapText(msgspec.Struct):
    """A map in TOML, before it is resolved for two bodies."""

    units: str = "same"
    otherwise: Any = "zero"
    observation: dict[str, Any] = {}
    action: dict[str, Any] = {}
    symmetry: MirrorText | None = None


def read_toml(text: str) -> MapText:
    """Parse a map in TOML."""
    try:
        table = tomllib.loads(text.removeprefix("\ufeff"))  # Windows editors prepend a mark.
    except tomllib.TOMLDecodeError as error:
        raise MapError(f"This is not TOML: {error}.") from error
    _check_keys("key", table, MapText.__struct_fields__)
    found = _as("map", table, MapText)
    _one_of("units", found.units, get_args(Units))
    if found.symmetry is not None:
        _check_keys("key of 'symmetry'", table["symmetry"], MirrorText.__struct_fields__)
        _one_of("of", found.symmetry.of, ("source", "target"))
    found.otherwise = _rule("otherwise", found.otherwise)
    for rules in (found.observation, found.action):
        rules |= {name: _rule(name, value) for name, value in rules.items()}
    return found


def _rule(name: str, value: object) -> RuleLike:
    """Parse the value of a rule."""
    if isinstance(value, str):
        if not value.startswith(_COPY):
            _one_of(name, value, _WORDS)
        return value
    table = _as(name, value, dict[str, Any])
    _check_keys(f"key of {name!r}", table, ("take", "scale", "hold"))
    if table.keys() == {"hold"}:
        return Hold(_as(name, table["hold"], float))
    if table.keys() in ({"take"}, {"take", "scale"}):
        return Copy(_as(name, table["take"], str), _as(name, table.get("scale", 1.0), float))
    raise MapError(
        f'{name!r} must be {{ take = "NAME" }}, {{ take = "NAME", scale = NUMBER }} or '
        f"{{ hold = NUMBER }}, not a table of {', '.join(table) or 'nothing'}."
    )


def _as(name: str, value: object, kind: type[_Read]) -> _Read:
    """Convert a value to its type."""
    try:
        return msgspec.convert(value, type=kind)
    except msgspec.ValidationError as error:
        raise MapError(f"{name!r} is wrong: {error}.") from error


def _one_of(name: str, word: str, known: Sequence[str]) -> None:
    if word not in known:
        raise MapError(f"{name}: {UnknownName('word', word, known)}")


def _check_keys(kind: str, table: Mapping[str, object], known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            raise MapError(str(UnknownName(kind, key, known)))
