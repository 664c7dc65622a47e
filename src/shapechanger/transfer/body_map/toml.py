"""Body maps as text that a person can write.

    units = "same"                      # or "torque"
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

Each part may be left out. Features that bear the same name in both bodies need no line.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple, TypeVar

import msgspec

from shapechanger.errors import MapError, UnknownName
from shapechanger.transfer.body_map.entries import Entry
from shapechanger.transfer.body_map.matching import Units
from shapechanger.transfer.body_map.rules import Hold, Learn, Rule, RuleLike, Take, Zero

__all__ = ["MirrorText", "Text", "read", "write"]

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


def write(observation: Iterable[Entry], action: Iterable[Entry]) -> str:
    """The text that gives these rules; a partner of the same name has no line."""
    lines = ['units = "same"', 'otherwise = "zero"']
    for heading, entries in (("observation", observation), ("action", action)):
        told = [entry for entry in entries if entry.rule != Take(entry.feature)]
        if told:
            lines += ["", f"[{heading}]"]
            lines += [f"{_quoted(entry.feature)} = {_value(entry.rule)}" for entry in told]
    return "\n".join(lines) + "\n"


def _value(rule: Rule) -> str:
    match rule:
        case Take(feature, scale):
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
        return Take(_as(name, table["take"], str), _as(name, table.get("scale", 1.0), float))
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
