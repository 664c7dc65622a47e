"""Which rule each feature gets: by its exact name, by its namesake, by a pattern, or by default."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Mapping
from typing import Final, Literal, NamedTuple

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature
from shapechanger.transfer.body_map.entries import BY_DEFAULT, SAME_NAME, Entry, Side
from shapechanger.transfer.body_map.rules import Hold, Learn, Rule, RuleLike, Take, Zero
from shapechanger.transfer.body_map.wildcards import filled_in

__all__ = ["Resolution", "Units", "check_patterns", "constant_rule", "resolve"]

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

    entries: tuple[Entry, ...]
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
    entries: list[Entry] = []
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
            rule = _suited(Take(feature.name), feature, side, units)
            entries.append(Entry(feature.name, rule, SAME_NAME))
            continue
        elif fits:
            pattern = fits[0]
        else:
            entries.append(Entry(feature.name, constant_rule(otherwise, feature), BY_DEFAULT))
            continue
        used.add(pattern)
        rule = _suited(_read(rules[pattern], pattern, feature, side), feature, side, units)
        entries.append(Entry(feature.name, rule, f"rule {pattern!r}"))
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
        case Take(name, scale):
            pass
        case Zero() | Hold() | Learn() | "hold" | "zero" | "learn":
            return constant_rule(like, feature)
        case words if words.startswith(_COPY):
            name, scale = words.removeprefix(_COPY).strip(), 1.0
        case _:
            known = ("zero", "hold", "learn", "copy NAME")
            raise MapError(f"{feature.name}: {UnknownName('rule', like, known)}")
    return Take(name if name in side.over else filled_in(name, pattern, feature.name), scale)


def _suited(rule: Rule, feature: Feature, side: Side, units: Units) -> Rule:
    """The rule with its scale in the units asked for, once it is seen to suit the feature."""
    if not isinstance(rule, Take):
        return rule
    conversion = _conversion(rule.scale, side.taken(rule.feature), feature, side, units)
    return Take(rule.feature, rule.scale * conversion)


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


def _refuse_strangers(side: Side, entries: Iterable[Entry]) -> None:
    """Refuse a side on which nothing matches and somebody has not said what to do about it."""
    entries = tuple(entries)
    if any(isinstance(entry.rule, Take) for entry in entries):
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
