"""Find the rule of each feature, by exact name, same name, pattern or default; read maps in TOML.

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

The mirror is the plane y = 0, with x forward and z up. It changes the sign of the y component of a
vector (position, velocity, force) and of the x and z components of an axial vector (angular
velocity, torque). A rotation about the axis n becomes the rotation by the same angle about n with
its y component kept and the others negated, so a quaternion (w, x, y, z) negates x and z. The angle
of a hinge keeps its sign if its axis, changed in this way, is the axis of its partner. It changes
its sign if the changed axis is opposite to the partner's: the caller lists such hinges in `flip`.
"""

from __future__ import annotations

import fnmatch
import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, TypeVar, get_args

import msgspec

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
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
# Last parts of feature names that change sign in the mirror: components along an axis of the world
# and products of inertia with y. `_KEPT` has the last parts that keep their sign.
_NEGATED: Final = frozenset({"y", "vy", "fy", "wx", "wz", "tx", "tz", "qx", "qz", "xy", "yz", "my"})
_KEPT: Final = frozenset(
    {"x", "z", "vx", "vz", "fx", "fz", "wy", "ty", "qw", "qy", "xx", "yy", "zz", "xz", "mx", "mz"}
    | {"cos"}
)


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
            why = f"rule {fitting[0]!r}"
        else:
            rule, why = constant_rule(otherwise, feature), BY_DEFAULT
        entries.append(MapEntry(name, _suited(rule, feature, side, units), why))
    _require_match(side, entries)
    return tuple(entries)


def _matches(pattern: str, name: str, side: Side) -> bool:
    """Return whether a pattern is the name of a feature, or a glob that matches it."""
    return pattern == name or (pattern not in side.into and fnmatch.fnmatchcase(name, pattern))


def check_patterns(
    patterns: Iterable[str], halves: Sequence[tuple[Side, tuple[MapEntry, ...]]]
) -> None:
    """Check that each pattern provides the rule of at least one feature."""
    reasons = {entry.why for _, entries in halves for entry in entries}
    for pattern in patterns:
        if f"rule {pattern!r}" in reasons:
            continue
        names = [(name, side) for side, _ in halves for name in side.into.names]
        if not any(_matches(pattern, name, side) for name, side in names):
            kind = " or ".join(side.into_kind for side, _ in halves)
            raise UnknownName(kind, pattern, [name for name, _ in names])
        raise MapError(
            f"The rule {pattern!r} changes nothing: each feature that it matches has a partner "
            "of the same name or another rule; name a feature exactly to override that."
        )


def constant_rule(like: RuleLike, feature: Feature) -> Rule:
    """Return the rule of a feature that copies no other feature."""
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
                f"The rule of remaining features must be 'zero', 'hold' or 'learn', got {like!r}."
            )


def _read(like: RuleLike, pattern: str, feature: Feature, side: Side, units: Units) -> Rule:
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
    """Return the rule with its scale in the requested units; raise if it does not fit."""
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
    """Refuse a side on which no feature matches and not every feature has an explicit rule."""
    if any(isinstance(e.rule, Copy) for e in entries) or all(e.why != BY_DEFAULT for e in entries):
        return
    into, over = side.into.names, side.over.names

    def listed(names: tuple[str, ...]) -> str:
        more = len(names) - _MOST_NAMES_LISTED
        shown = ", ".join(names[:_MOST_NAMES_LISTED]) or "none"
        return f"{shown} and {more} more" if more > 0 else shown

    example = f"copy {over[0]}" if over else "hold"
    raise MapError(
        f"These {side.name} spaces cannot be mapped, because no name occurs in both: the "
        f"{side.into_kind}s are {listed(into)}; the {side.over_kind}s are {listed(over)}. "
        f"Write a rule for each, such as rules={{{into[0]!r}: {example!r}}}."
    )


_Read = TypeVar("_Read")


class MirrorText(msgspec.Struct):
    """The part `[symmetry]` of a map in TOML."""

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


def mirrored_entries(
    observation: Layout, action: Layout, swap: Mapping[str, str], flip: Iterable[str]
) -> tuple[tuple[MapEntry, ...], tuple[MapEntry, ...]]:
    """Return the observation and action entries of `BodyMap.mirror`."""
    names = (*observation.names, *action.names)
    elements = tuple(dict.fromkeys(name.split("/", 1)[0] for name in names))
    partners = _both_ways(swap, elements)
    flipped = frozenset(name for glob in flip for name in _fitting(glob, elements))
    for element, partner in partners.items():
        if (element in flipped) != (partner in flipped):
            raise MapError(f"{element!r} and {partner!r} mirror each other: flip both or neither.")
    return (
        tuple(_reflected(feature, observation, partners, flipped) for feature in observation),
        tuple(_reflected(feature, action, partners, flipped) for feature in action),
    )


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
    """Return the element of this exact name, or else the elements that the glob matches."""
    fits = [glob] if glob in elements else [e for e in elements if fnmatch.fnmatchcase(e, glob)]
    if not fits:
        raise UnknownName("element", glob, elements)
    return fits


def _reflected(
    feature: Feature, layout: Layout, partners: Mapping[str, str], flipped: frozenset[str]
) -> MapEntry:
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
    for aspect in ("unit", "shape", "gain", "gain_unit"):
        ours, theirs = getattr(feature, aspect), getattr(partner, aspect)
        if ours != theirs:
            raise MapError(
                f"{feature.name!r} and {partner.name!r} cannot swap: "
                f"their {aspect} is {ours!r} and {theirs!r}."
            )
    low, high = sorted((scale * partner.low, scale * partner.high))
    # The ranges may differ by rounding, such as from degrees to radians.
    if not all(
        math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12)
        for a, b in ((low, feature.low), (high, feature.high))
    ):
        raise MapError(
            f"{feature.name!r} reaches from {feature.low:g} to {feature.high:g} and "
            f"{partner.name!r} times {scale:g} from {low:g} to {high:g}: "
            "the body has no such symmetry."
        )
