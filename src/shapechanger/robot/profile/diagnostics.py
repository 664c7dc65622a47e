"""Tables of a profile, decoded by msgspec; every error names its line, its key and the way out."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable, Mapping
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any, Final, cast

import msgspec
from msgspec import inspect

from shapechanger.errors import ProfileError
from shapechanger.robot.drivers.keys import KeyMistake
from shapechanger.robot.drivers.pins import HIGHEST_BCM, NO_PIN, OptionalPin, Pin, bcm

Place = tuple[str | int, ...]
"""Path to a value: names of tables and keys, and indices into table arrays."""


def line_of(text: str, place: Place) -> int:
    """Return the line on which a table or key of a TOML text begins, from 1.

    `tomllib` keeps no line numbers, but a text that is cut off at the end of a statement is valid
    TOML, and one that is cut off within a statement is not. So the line follows from the longest
    valid beginning without the key and the shortest one with it.

    Args:
        text: Valid TOML, with Unix line ends.
        place: The table or key; for a missing one the line of its table is returned.
    """
    whole = tomllib.loads(text)
    while place and not _has(whole, place):
        place = place[:-1]
    lines = text.split("\n")
    without, having = 0, len(lines)
    while True:
        middle = max((without + having) // 2, without + 1)
        counts = (*range(middle, having), *range(middle - 1, without, -1))
        begun = next(filter(None, (_begun(lines, count) for count in counts)), None)
        if begun is None or not place:
            return without + 1
        count, data = begun
        if _has(data, place):
            having = count
        else:
            without = count


def _begun(lines: list[str], count: int) -> tuple[int, Any] | None:
    """Return the number of lines and their content, or None if they end within a statement."""
    try:
        return count, tomllib.loads("\n".join(lines[:count]))
    except tomllib.TOMLDecodeError:
        return None


def _has(data: Any, place: Place) -> bool:
    try:
        for name in place:
            data = data[name]
    except (KeyError, IndexError, TypeError):
        return False
    return True


_LONGEST_SHOWN: Final = 40


def choice(name: str, known: Iterable[str]) -> str:
    """Describe an unknown name: the nearest spelling and the known names."""
    names = sorted(known)
    return f"{name!r}{nearest(name, names)}; there are: {', '.join(names) or 'none'}"


def nearest(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean ...?)", or an empty string if nothing is similar."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def shown(value: Any) -> str:
    """Format a value as TOML, shortening tables and long strings."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            short = value if len(value) <= _LONGEST_SHOWN else f"{value[:_LONGEST_SHOWN]}…"
            return f"the text {short!r}"
        case dict():
            return "a table"
        case list():
            items = cast("list[Any]", value)
            return f"a list of {len(items)}" if items else "an empty list"
        case int() if abs(value) >= 10**_LONGEST_SHOWN:
            return "a number too large to write"  # Python refuses to print thousands of digits.
        case int() | float():
            return repr(value)
        case _:
            return f"the date {value}" if isinstance(value, date) else f"the time {value}"


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
    """Return the unit in the suffix of a key, spelled out; empty for none."""
    return next((unit for end, unit in _UNITS.items() if key.endswith(end)), "")


def _stem_of(key: str) -> str:
    """Return the name of a key without its unit."""
    return next((key.removesuffix(e) for e in (*_UNITS, *_OTHER_ENDS) if key.endswith(e)), key)


@cache
def fields_of(kind: type) -> dict[str, inspect.Field]:
    """Return the keys that a Struct or dataclass declares, keyed by name."""
    info = cast("inspect.StructType", inspect.type_info(kind))
    return {field.encode_name: field for field in info.fields}


def _permitted(key: str, kind: inspect.Type) -> str:
    """Describe the permitted values of a key."""
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
            return _permitted(key, kind.types[0])
        case _:
            longest = cast("inspect.StrType", kind).max_length
            return f"a text of 1 to {longest} characters that can be printed"


def _range(kind: inspect.IntType | inspect.FloatType) -> str:
    if kind.gt is not None:
        return f" above {kind.gt:g}" + (f" and up to {kind.le:g}" if kind.le is not None else "")
    return f" from {kind.ge:g} to {kind.le:g}"


def _refused(value: Any, kind: inspect.Type) -> str:
    """Describe a value that its type does not permit, as the end of a sentence."""
    if isinstance(kind, inspect.LiteralType) and isinstance(value, str):
        return f"not {value!r}{nearest(value, map(str, kind.values))}"
    if isinstance(kind, inspect.DictType) and isinstance(value, dict):
        # The path of msgspec does not name the entry.
        bounds: Any = kind.value_type
        for name, weight in cast("dict[str, Any]", value).items():
            if type(weight) not in (int, float) or not bounds.ge <= weight <= bounds.le:
                return f"and the one of {name} is {shown(weight)}"
    return f"not {shown(value)}"


def _pin(kind: type[Pin], written: Any) -> Pin:
    """Convert a pin for msgspec; the message of the error is the end of a sentence."""
    if kind is OptionalPin and type(written) is int and written == NO_PIN:
        return NO_PIN
    try:
        return kind(bcm(written))
    except ValueError as error:
        raise ValueError(str(error) or f"not {shown(written)}") from None


def called(*place: str | int) -> str:
    """Format the name of a table as in TOML: `[output.drive]`."""
    if isinstance(place[-1], int):
        return f"[[{'.'.join(map(str, place[:-1]))}]] number {place[-1] + 1}"
    return f"[{'.'.join(map(str, place))}]"


class Section:
    """One table of a profile and its place.

    Every method raises a `ProfileError` with one sentence and the line.

    Args:
        path: The file.
        text: Its content.
        place: Path of the table.
        table: Its keys and nested tables; anything else is refused.
    """

    def __init__(self, path: Path, text: str, place: Place, table: Any) -> None:
        self.path = path
        self.place = place
        self._text = text
        if not isinstance(table, dict):
            raise self.error_at((), f"{self} must be a table, not {shown(table)}")
        self.table = cast("dict[str, Any]", table)

    def __str__(self) -> str:
        return called(*self.place)

    def line(self, keys: Place) -> int:
        """Return the line of one of its keys; for a missing one, the line of its table."""
        return line_of(self._text, (*self.place, *keys))

    def error_at(self, keys: str | Place, message: str) -> ProfileError:
        """Return an error with file, line and message."""
        keys = (keys,) if isinstance(keys, str) else keys
        return ProfileError(f"{self.path}, line {self.line(keys)}: {message}.")

    def section(self, *names: str | int, table: Any = None) -> Section:
        """Return a nested table: `table`, or the one with these names, empty if it is missing."""
        if table is None:
            table = self.table
            for name in names:
                table = table.get(name, {})
        return Section(self.path, self._text, (*self.place, *names), table)

    def within(self, table: dict[str, Any]) -> Section:
        """Return this table with only some of its keys."""
        return Section(self.path, self._text, self.place, table)

    def named(self) -> dict[str, Section]:
        """Return the nested tables keyed by name; refuse names that no part may have."""
        for name in self.table:
            if _NAME.fullmatch(name) is None:
                raise self.error_at(
                    name,
                    f"the name {name!r} must begin with a letter and have at most 32 letters, "
                    "digits, '_' and '-'",
                )
        return {name: self.section(name) for name in self.table}

    def chosen(self, key: str, names: Iterable[str]) -> str:
        """Return the value of a key that is one of some names."""
        options = f"one of {', '.join(repr(name) for name in names)}"
        if key not in self.table:
            raise self.error_at((), f"{self} lacks the key {key!r}, {options}")
        written = self.table[key]
        if isinstance(written, str) and written in names:
            return written
        refused = f"not {shown(written)}"
        if isinstance(written, str):
            refused = f"not {written!r}{nearest(written, names)}"
        raise self.error_at(key, f"{key} of {self} must be {options}, {refused}")

    def decode(
        self,
        *kinds: type,
        given: Mapping[str, Any] | None = None,
        others: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> tuple[Any, ...]:
        """Return one value of each type, whose fields together are the keys of the table.

        Args:
            kinds: Structs and dataclasses.
            given: Fields that are no keys of the table.
            others: Chips, or keys, of other drivers, which an unknown key may belong to.
        """
        given = given or {}
        known = {
            name: field
            for kind in kinds
            for name, field in fields_of(kind).items()
            if name not in given
        }
        for name in self.table:
            if name not in known:
                raise self.error_at(name, self._unknown(name, known, others or {}))
        for name, field in known.items():
            if field.required and name not in self.table:
                permitted = _permitted(name, field.type)
                raise self.error_at((), f"{self} lacks the key {name!r}, {permitted}")
        table = {**self.table, **given}
        return tuple(self._converted(kind, table) for kind in kinds)

    def _unknown(self, name: str, known: Iterable[str], others: Mapping[str, Any]) -> str:
        for key in known:
            if _unit_of(key) and _stem_of(key) == _stem_of(name):
                unit = _unit_of(key)
                return (
                    f"{name!r} of {self} lacks its unit or has another one: write {key!r} ({unit})"
                )
        for what, drivers in others.items():
            having = [
                driver
                for driver, chip in drivers.items()
                if name in fields_of(chip if isinstance(chip, type) else chip.keys)
            ]
            if having:
                return f"{name!r} belongs to {what} {' and '.join(having)}, not to {self}"
        return f"{self} has no key {choice(name, known)}"

    def _converted(self, kind: type, table: dict[str, Any]) -> Any:
        try:
            return cast("Any", msgspec.convert(table, kind, dec_hook=_pin))
        except msgspec.ValidationError as error:
            cause = error.__cause__
            if isinstance(cause, KeyMistake):
                raise self.error_at(cause.key, f"{cause.key} of {self} {cause}") from None
            key = _PATH.findall(str(error))[0]  # Missing keys were found before.
            field = fields_of(kind)[key].type
            refused = str(cause) if cause else _refused(table[key], field)
            permitted = _permitted(key, field)
            raise self.error_at(key, f"{key} of {self} must be {permitted}, {refused}") from None
