"""Tables of a profile, read into the types that declare their keys.

`msgspec` converts and checks; each of its errors becomes one sentence with the line, the key, its
permitted values, and the nearest spelling.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cache
from typing import Any, Final, cast

import msgspec
from msgspec import inspect

from shapechanger.errors import ProfileError
from shapechanger.robot.drivers.keys import KeyMistake
from shapechanger.robot.drivers.pins import HIGHEST_BCM, NO_PIN, OptionalPin, Pin, bcm
from shapechanger.robot.profile.mistakes import Place, Source, called, choice, nearest, shown

_UNITS: Final = {
    "_deg_per_s": "degrees a second",
    "_deg_per_m": "degrees a metre",
    "_deg": "degrees",
    "_per_s": "per second",
    "_hz": "hertz",
    "_ms": "milliseconds",
    "_us": "microseconds",
    "_m": "metres",
    "_s": "seconds",
    "_v": "volts",
    "_c": "degrees Celsius",
}
"""Units by the suffix of a key, longest first."""

# Common alternative spellings.
_OTHER_ENDS: Final = ("_rad", "_cm", "_mm", "_km", "_mv", "_f", "_sec", "_khz", "_min")

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
_PATH: Final = re.compile(r" - at `\$\.(\w+)")
_A_PIN: Final = f'a BCM pin from 0 to {HIGHEST_BCM}, such as 22, "GPIO22" or "BOARD15"'


def _unit_of(key: str) -> str:
    """Return the unit in the suffix of a key, in words; empty for none."""
    return next((unit for end, unit in _UNITS.items() if key.endswith(end)), "")


def _stem_of(key: str) -> str:
    """Return the name of a key without its unit."""
    return next((key.removesuffix(e) for e in (*_UNITS, *_OTHER_ENDS) if key.endswith(e)), key)


@cache
def fields_of(kind: type) -> dict[str, inspect.Field]:
    """Return the keys that a type declares, by name."""
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType | inspect.DataclassType)
    return {field.encode_name: field for field in info.fields}


def wanted(key: str, kind: inspect.Type) -> str:
    """Describe the permitted values of a key.

    Args:
        key: Its name, which may end in a unit.
        kind: Its type.
    """
    match kind:
        case inspect.IntType() | inspect.FloatType():
            number = "a whole number" if isinstance(kind, inspect.IntType) else "a number"
            if (step := kind.multiple_of) is not None:
                number += f" in steps of {step:g}"
            unit = _unit_of(key)
            return f"{number}{_range(kind)}{f' ({unit})' if unit else ''}"
        case inspect.LiteralType():
            return f"one of {', '.join(repr(value) for value in kind.values if value)}"
        case inspect.BoolType():
            return "true or false"
        case inspect.DateType():
            return "a date, such as 2026-11-03"
        case inspect.DictType():
            return f"a table of numbers{_range(cast('Any', kind.value_type))} by name of action"
        case inspect.TupleType():
            ends = _range(cast("Any", kind.item_types[0]))
            return f"[width, height] in pixels, each an even number{ends}"
        case inspect.ListType():
            return f"a list of pins, each {_A_PIN}"
        case inspect.CustomType():
            return f"{_A_PIN}, or {NO_PIN} for none" if kind.cls is OptionalPin else _A_PIN
        case inspect.UnionType():
            return wanted(key, kind.types[0])
        case _:
            longest = cast("inspect.StrType", kind).max_length
            return f"a text of 1 to {longest} characters that can be printed"


def _range(kind: inspect.IntType | inspect.FloatType) -> str:
    if kind.gt is not None:
        return f" above {kind.gt:g}" + (f" and up to {kind.le:g}" if kind.le is not None else "")
    return f" from {kind.ge:g} to {kind.le:g}"


def _pin(kind: type, written: Any) -> Any:
    """Convert a pin; the error of another one is the end of a sentence."""
    if kind is OptionalPin and type(written) is int and written == NO_PIN:
        return NO_PIN
    try:
        return cast("type[Pin]", kind)(bcm(written))
    except ValueError as error:
        raise ValueError(str(error) or f"not {shown(written)}") from None


class Section:
    """One table of a profile and its path, so that a mistake in it can be located.

    Every method raises a `ProfileError` with one sentence and the line.

    Args:
        source: Where the profile was read.
        place: Path of the table.
        table: Its keys and nested tables; anything else is refused.
    """

    def __init__(self, source: Source, place: Place, table: Any) -> None:
        self.source = source
        self.place = place
        if not isinstance(table, dict):
            raise self.mistake(f"{self} must be a table, not {shown(table)}")
        self.table = cast("dict[str, Any]", table)

    def __str__(self) -> str:
        return called(self.place)

    def __contains__(self, name: str) -> bool:
        return name in self.table

    def mistake(self, words: str, *at: str | int) -> ProfileError:
        """Return the error for a mistake in this table, or in one of its keys.

        Args:
            words: What is wrong, without the place.
            at: Keys and indices from this table to the mistake.
        """
        return self.source.mistake((*self.place, *at), words)

    def section(self, name: str) -> Section:
        """Return a nested table, which is empty if it is missing."""
        return Section(self.source, (*self.place, name), self.table.get(name, {}))

    def named(self) -> dict[str, Section]:
        """Return the nested tables by name; refuse names that are not allowed for a part."""
        for name in self.table:
            if _NAME.fullmatch(name) is None:
                words = "must begin with a letter and have at most 32 letters, digits, '_' and '-'"
                raise self.mistake(f"the name {name!r} {words}", name)
        return {name: self.section(name) for name in self.table}

    def chosen(self, key: str, names: Collection[str]) -> str:
        """Return the value of a key that names one of several things, such as a driver."""
        written = self.table.get(key)
        if isinstance(written, str) and written in names:
            return written
        words = f"one of {', '.join(map(repr, names))}"
        if key not in self.table:
            raise self.mistake(f"{self} lacks the key {key!r}, {words}")
        raise self.mistake(f"{key} of {self} must be {words}, {_no_choice(written, names)}", key)

    def read(
        self,
        *kinds: Callable[..., Any],
        given: Mapping[str, Any] | None = None,
        others: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> tuple[Any, ...]:
        """Return one value of each type, whose fields together are the keys of the table.

        Args:
            kinds: Structs and dataclasses.
            given: Fields that are no keys of the table.
            others: Chips, or keys, by driver, that may have an unknown key; by what they are.
        """
        given = given or {}
        known = {
            name: field
            for kind in kinds
            for name, field in fields_of(cast("type", kind)).items()
            if name not in given
        }
        for name in self.table:
            if name not in known:
                raise self._unknown(name, known, others or {})
        for name, field in known.items():
            if field.required and name not in self.table:
                words = wanted(name, field.type)
                raise self.mistake(f"{self} lacks the key {name!r}, {words}")
        return tuple(self._converted(cast("type", kind), {**self.table, **given}) for kind in kinds)

    def _unknown(self, name: str, known: Iterable[str], others: Mapping[str, Any]) -> ProfileError:
        meant = (k for k in known if _unit_of(k) and _stem_of(k) == _stem_of(name))
        if (key := next(meant, None)) is not None:
            words = f"{name!r} of {self} lacks its unit or has another one: write {key!r}"
            return self.mistake(f"{words} ({_unit_of(key)})", name)
        for what, drivers in others.items():
            having = [
                driver
                for driver, chip in drivers.items()
                if name in fields_of(chip if isinstance(chip, type) else chip.keys)
            ]
            if having:
                words = f"{name!r} belongs to {what} {' and '.join(having)}, not to {self}"
                return self.mistake(words, name)
        return self.mistake(f"{self} has no key {choice(name, known)}", name)

    def _converted(self, kind: type, table: dict[str, Any]) -> Any:
        fields = fields_of(kind)
        mine = {name: value for name, value in table.items() if name in fields}
        try:
            return cast("Any", msgspec.convert(mine, kind, dec_hook=_pin))
        except msgspec.ValidationError as error:
            cause = error.__cause__
            if isinstance(cause, KeyMistake):
                raise self.mistake(f"{cause.key} of {self} {cause}", cause.key) from None
            match = _PATH.search(str(error))
            assert match is not None  # Missing keys were found before.
            key = match[1]
            field, value = fields[key].type, mine[key]
            words = str(cause) if cause else f"not {shown(value)}"
            if isinstance(field, inspect.DictType) and isinstance(value, dict):
                words = _wrong_weight(cast("dict[str, Any]", value), field.value_type)
            elif isinstance(field, inspect.LiteralType):
                words = _no_choice(value, map(str, field.values))
            words = f"{key} of {self} must be {wanted(key, field)}, {words}"
            raise self.mistake(words, key) from None


def _no_choice(written: Any, names: Iterable[str]) -> str:
    """Return the end of a sentence about a value that is none of several."""
    if isinstance(written, str):
        return f"not {written!r}{nearest(written, names)}"
    return f"not {shown(written)}"


def _wrong_weight(weights: dict[str, Any], bounds: Any) -> str:
    """Name the first weight of a table that is not permitted: msgspec's path does not."""
    name, weight = next(
        (name, weight)
        for name, weight in weights.items()
        if type(weight) not in (int, float) or not bounds.ge <= weight <= bounds.le
    )
    return f"and the one of {name} is {shown(weight)}"
