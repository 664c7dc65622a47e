"""Which rule each feature gets: by its exact name, by its namesake, by a pattern, or by default."""

from __future__ import annotations

import fnmatch
import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple, TypeVar

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

__all__ = [
    "MirrorText",
    "Resolution",
    "Text",
    "Units",
    "check_patterns",
    "constant_rule",
    "read",
    "resolve",
    "write",
]

Units = Literal["same", "torque"]

_COPY: Final = "copy "
_MOST_NAMES_LISTED: Final = 8
_SPELLED: Final[dict[str, Rule]] = {"zero": Zero(), "learn": Learn()}


class Resolution(NamedTuple):
    """The rules of one side, and what became of the patterns.

    Attributes:
        entries: One for each feature that is filled.
        fitting: The patterns that fit the name of a feature.
        used: The patterns that gave a feature its rule.
    """

    entries: tuple[MapEntry, ...]
    fitting: frozenset[str]
    used: frozenset[str]


def resolve(
    side: Side, rules: Mapping[str, RuleLike], otherwise: RuleLike, units: Units
) -> Resolution:
    """Give each feature of `side.into` its rule.

    Args:
        side: What is filled, and from what.
        rules: For a name or a glob its rule; the first glob that fits is the one that counts.
        otherwise: The rule of what is left: zero, hold or learn.
        units: What a scale of 1 keeps, see `BodyMap.between`.

    Raises:
        MapError: If a rule does not suit its feature, or nothing matches.
        UnknownName: If a rule takes a feature that is not there.
    """
    entries: list[MapEntry] = []
    fitting: set[str] = set()
    used: set[str] = set()
    for feature in side.into:
        fits = [
            pattern
            for pattern in rules
            if pattern == feature.name
            or (pattern not in side.into and fnmatch.fnmatchcase(feature.name, pattern))
        ]
        fitting.update(fits)
        if feature.name in rules:
            pattern = feature.name
        elif feature.name in side.over:
            rule = _suited(Copy(feature.name), feature, side, units)
            entries.append(MapEntry(feature.name, rule, SAME_NAME))
            continue
        elif fits:
            pattern = fits[0]
        else:
            entries.append(MapEntry(feature.name, constant_rule(otherwise, feature), BY_DEFAULT))
            continue
        used.add(pattern)
        rule = _suited(_read(rules[pattern], pattern, feature, side), feature, side, units)
        entries.append(MapEntry(feature.name, rule, f"rule {pattern!r}"))
    _refuse_strangers(side, entries)
    return Resolution(tuple(entries), frozenset(fitting), frozenset(used))


def check_patterns(
    patterns: Iterable[str], sides: Iterable[Side], resolutions: Iterable[Resolution]
) -> None:
    """See that each pattern gave at least one feature its rule.

    Raises:
        UnknownName: If a pattern fits no feature of any of `sides`.
        MapError: If each feature that it fits has its rule from elsewhere.
    """
    sides, resolutions = tuple(sides), tuple(resolutions)
    for pattern in patterns:
        if not any(pattern in resolution.fitting for resolution in resolutions):
            kind = " or ".join(side.into_kind for side in sides)
            raise UnknownName(kind, pattern, [name for side in sides for name in side.into.names])
        if not any(pattern in resolution.used for resolution in resolutions):
            raise MapError(
                f"The rule {pattern!r} changes nothing: each feature that it fits has a partner "
                "of the same name or an earlier rule; name a feature exactly to overrule that."
            )


def constant_rule(like: RuleLike, feature: Feature) -> Rule:
    """Read a rule that takes nothing, for a feature that is left over.

    Raises:
        MapError: If it is not zero, hold or learn, or holds what the feature never is.
    """
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
                f"What is left over gets one rule, 'zero', 'hold' or 'learn', and not {like!r}."
            )


def _read(like: RuleLike, pattern: str, feature: Feature, side: Side) -> Rule:
    """The rule that was meant for `feature` under `pattern`."""
    match like:
        case Copy(name, scale):
            pass
        case Zero() | Hold() | Learn() | "hold" | "zero" | "learn":
            return constant_rule(like, feature)
        case words if words.startswith(_COPY):
            name, scale = words.removeprefix(_COPY).strip(), 1.0
        case _:
            known = ("zero", "hold", "learn", "copy NAME")
            raise MapError(f"{feature.name}: {UnknownName('rule', like, known)}")
    return Copy(name if name in side.over else expand_template(name, pattern, feature.name), scale)


def _suited(rule: Rule, feature: Feature, side: Side, units: Units) -> Rule:
    """The rule with its scale in the units asked for, once it is seen to suit the feature."""
    if not isinstance(rule, Copy):
        return rule
    conversion = _conversion(rule.scale, side.taken(rule.feature), feature, side, units)
    return Copy(rule.feature, rule.scale * conversion)


def _conversion(scale: float, taken: Feature, feature: Feature, side: Side, units: Units) -> float:
    """What a number of `taken` is multiplied by, besides its scale, to be one of `feature`."""
    if units == "torque" and side.name == "action":
        if taken.gain_unit != feature.gain_unit:
            raise MapError(
                f"One unit of {taken.name!r} gives {taken.gain:g} {taken.gain_unit or '(unknown)'}"
                f" and one of {feature.name!r} {feature.gain:g} "
                f"{feature.gain_unit or '(unknown)'}: units='torque' cannot make them equal; "
                "use units='same'."
            )
        if taken.gain_unit:
            return taken.gain / feature.gain
    if taken.unit != feature.unit and abs(scale) == 1.0:
        raise MapError(
            f"The {side.into_kind} {feature} cannot take the {side.over_kind} {taken} as it is, "
            f"for the units differ: give {feature.name!r} a rule of its own, "
            "with the scale that converts them."
        )
    return 1.0


def _refuse_strangers(side: Side, entries: Iterable[MapEntry]) -> None:
    """Refuse a side on which nothing matches and somebody has not said what to do about it."""
    entries = tuple(entries)
    if any(isinstance(entry.rule, Copy) for entry in entries):
        return
    if all(entry.why != BY_DEFAULT for entry in entries):
        return  # Each feature was given its rule in so many words.
    into, over = side.into.names, side.over.names
    example = f"copy {over[0]}" if over else "hold"
    raise MapError(
        f"These {side.name} spaces cannot be mapped, for no name occurs in both: the "
        f"{side.into_kind}s are {_listed(into)}; the {side.over_kind}s are {_listed(over)}. "
        f"Write a rule for each, such as rules={{{into[0]!r}: {example!r}}}."
    )


def _listed(names: tuple[str, ...]) -> str:
    """The first names in one line."""
    more = len(names) - _MOST_NAMES_LISTED
    shown = ", ".join(names[:_MOST_NAMES_LISTED]) or "none"
    return f"{shown} and {more} more" if more > 0 else shown


_WORDS: Final = ("zero", "hold", "learn")

_Read = TypeVar("_Read")


class MirrorText(NamedTuple):
    """The mirror that a text asks for.

    Attributes:
        of: Whose mirror image it is.
        swap: For an element its partner on the other side.
        flip: Globs of elements whose coordinate changes its sign.
    """

    of: Literal["source", "target"]
    swap: dict[str, str]
    flip: tuple[str, ...]


class Text(NamedTuple):
    """What a text asks for, before it meets two bodies.

    Attributes:
        units: What a scale of 1 keeps.
        otherwise: The rule of features that nothing matches.
        observation: Rules of source observation features.
        action: Rules of target action features.
        symmetry: The mirror that the map goes through, if any.
    """

    units: Units
    otherwise: RuleLike
    observation: dict[str, RuleLike]
    action: dict[str, RuleLike]
    symmetry: MirrorText | None


def read(text: str) -> Text:
    """Read a map that a person wrote.

    Raises:
        MapError: If it is no TOML, or holds a key, a word or a type that means nothing here.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MapError(f"This is not TOML: {error}.") from error
    _check_keys("key", table, Text._fields)
    observation = _as("observation", table.get("observation", {}), dict[str, Any])
    action = _as("action", table.get("action", {}), dict[str, Any])
    units = _as("units", table.get("units", "same"), str)
    return Text(
        units=_one_of("units", units, ("same", "torque")),
        otherwise=_rule("otherwise", table.get("otherwise", "zero")),
        observation={name: _rule(name, value) for name, value in observation.items()},
        action={name: _rule(name, value) for name, value in action.items()},
        symmetry=_mirror(table["symmetry"]) if "symmetry" in table else None,
    )


def write(observation: Iterable[MapEntry], action: Iterable[MapEntry]) -> str:
    """The text that gives these rules; a partner of the same name has no line."""
    lines = ['units = "same"', 'otherwise = "zero"']
    for heading, entries in (("observation", observation), ("action", action)):
        told = [entry for entry in entries if entry.rule != Copy(entry.feature)]
        if told:
            lines += ["", f"[{heading}]"]
            lines += [f"{_quoted(entry.feature)} = {_value(entry.rule)}" for entry in told]
    return "\n".join(lines) + "\n"


def _value(rule: Rule) -> str:
    match rule:
        case Copy(feature, scale):
            return f"{{ take = {_quoted(feature)}, scale = {float(scale)!r} }}"
        case Hold(value):
            return f"{{ hold = {float(value)!r} }}"
        case Zero():
            return '"zero"'
        case Learn():
            return '"learn"'


def _quoted(name: str) -> str:
    """A basic string of TOML: as JSON writes it, but for the one control character JSON lets by."""
    return json.dumps(name, ensure_ascii=False).replace("\x7f", "\\u007f")


def _rule(name: str, value: object) -> RuleLike:
    """A rule as it stands behind a name."""
    if isinstance(value, str):
        if not value.startswith("copy "):
            _one_of(name, value, (*_WORDS, "copy NAME"))
        return value
    table = _as(name, value, dict[str, Any])
    _check_keys(f"key of {name!r}", table, ("take", "scale", "hold"))
    if table.keys() == {"hold"}:
        return Hold(_as(name, table["hold"], float))
    if table.keys() in ({"take"}, {"take", "scale"}):
        return Copy(_as(name, table["take"], str), _as(name, table.get("scale", 1.0), float))
    raise MapError(
        f'{name!r} is to be {{ take = "NAME" }}, {{ take = "NAME", scale = NUMBER }} or '
        f"{{ hold = NUMBER }}, and not a table of {', '.join(table) or 'nothing'}."
    )


def _mirror(value: object) -> MirrorText:
    table = _as("symmetry", value, dict[str, Any])
    _check_keys("key of 'symmetry'", table, MirrorText._fields)
    of = _as("of", table.get("of", "source"), str)
    return MirrorText(
        of=_one_of("of", of, ("source", "target")),
        swap=_as("swap", table.get("swap", {}), dict[str, str]),
        flip=tuple(_as("flip", table.get("flip", []), list[str])),
    )


def _as(name: str, value: object, kind: type[_Read]) -> _Read:
    """The value, if it has the type that belongs here."""
    try:
        return msgspec.convert(value, type=kind)
    except msgspec.ValidationError as error:
        raise MapError(f"{name!r} is wrong: {error}.") from error


def _one_of(name: str, word: str, known: Sequence[str]) -> Any:
    """The word, if it is one of those known."""
    if word not in known:
        raise MapError(f"{name}: {UnknownName('word', word, known)}")
    return word


def _check_keys(kind: str, table: Mapping[str, object], known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            raise MapError(str(UnknownName(kind, key, known)))
