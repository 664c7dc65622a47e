"""Tables of a TOML file, decoded by msgspec; errors name the line and suggest a remedy."""

from __future__ import annotations

import difflib
import re
import reprlib
import tomllib
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import date, time
from functools import cache
from pathlib import Path
from typing import Any, Final, cast

import msgspec
from msgspec import inspect

from shapechanger.errors import ProfileError, translate_errors
from shapechanger.robot.drivers.chip import KeyMistake, Keys
from shapechanger.robot.drivers.pins import NO_PIN, OptionalPin, Pin, bcm

Place = tuple[str | int, ...]
"""Path to a value: names of tables and keys, and indices into table arrays."""


def line_of(text: str, place: Place) -> int:
    """Return the line on which a table or key of a TOML text begins, from 1.

    `tomllib` keeps no line numbers, but the first lines of a text, up to the end of a statement,
    are valid TOML: the key is on the last of the fewest first lines that contain it. The text must
    have Unix line ends. For a missing key the line of its table is returned.
    """
    lines = text.split("\n")

    def depth(count: int) -> int:
        """Return how many parts of `place` are in the first lines, up to the end of a statement."""
        while True:
            with suppress(tomllib.TOMLDecodeError):
                data: Any = tomllib.loads("\n".join(lines[:count]))
                break
            count += 1
        found = 0
        with suppress(KeyError, IndexError, TypeError):
            for name in place:
                data = data[name]
                found += 1
        return found

    counts = range(1, len(lines) + 1)
    return 1 + bisect_left(counts, depth(len(lines)), key=depth)


def choice(name: str, known: Iterable[str]) -> str:
    """Describe an unknown name: the nearest spelling and the known names."""
    names = sorted(known)
    return f"{name!r}{_nearest(name, names)}; there are: {', '.join(names) or 'none'}"


def _nearest(name: str, known: Iterable[str]) -> str:
    # A key without its unit, such as `slew` for `slew_per_s`, may not be close.
    with_unit = sorted((one for one in known if one.startswith(f"{name}_")), key=len)
    close = [*with_unit, *difflib.get_close_matches(name, known, n=1)]
    return f" (did you mean {close[0]!r}?)" if close else ""


def shown(value: Any) -> str:
    """Format a value of a TOML file, shortening long ones."""
    if isinstance(value, bool | float | date | time):
        return str(value).lower()
    with suppress(ValueError):  # Python refuses to print thousands of digits.
        return reprlib.repr(value)
    return "a number too large to write"


_MOST_NAMED: Final = 64  # Limit of the wire messages, see `shapechanger.robot.link.messages`.
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
_PATH: Final = re.compile(r" - at `\$\.(\w+)")


@cache
def fields_of(kind: type) -> dict[str, inspect.Field]:
    """Return the keys that a Struct or dataclass declares, keyed by name."""
    info = cast("inspect.StructType", inspect.type_info(kind))
    return {field.encode_name: field for field in info.fields}


def permitted(kind: inspect.Type) -> str:
    """Describe the values that a key may have: by `Meta(description=...)`, or by its type."""
    match kind:
        case inspect.Metadata():
            return cast("Any", kind).extra_json_schema["description"]
        case inspect.IntType() | inspect.FloatType():
            number = "a whole number" if isinstance(kind, inspect.IntType) else "a number"
            to = "to" if kind.gt is None else "and up to"
            ends = {"in steps of": kind.multiple_of, "from": kind.ge, "above": kind.gt, to: kind.le}
            given = (f"{word} {end:.9g}" for word, end in ends.items() if end is not None)
            return " ".join((number, *given))
        case inspect.LiteralType():
            return f"one of {', '.join(repr(value) for value in kind.values if value)}"
        case inspect.BoolType():
            return "true or false"
        case inspect.UnionType():
            return permitted(kind.types[0])
        case inspect.CustomType():
            return cast("type[Pin]", kind.cls).description
        case _:
            return f"a {type(kind).__name__.removesuffix('Type').lower()}"


def _pin(kind: type[Pin], written: Any) -> Pin:
    """Convert a pin for msgspec; the message of the error is the end of a sentence."""
    if kind is OptionalPin and type(written) is int and written == NO_PIN:
        return NO_PIN
    with translate_errors(
        ValueError, to=lambda error: ValueError(str(error) or f"not {shown(written)}")
    ):
        return kind(bcm(written))


@dataclass(frozen=True, slots=True)
class Table:
    """One table of a file, and its place."""

    path: Path
    text: str  # The whole text of the file.
    place: Place
    keys: dict[str, Any]  # Keys and nested tables of the table; any other type is refused.
    # All tables of the file that were decoded so far, with their `Keys`.
    decoded: list[tuple[Table, Keys]] = field(default_factory=list["tuple[Table, Keys]"])

    def __post_init__(self) -> None:
        """Refuse a value that is not a table."""
        if not isinstance(cast("Any", self.keys), dict):
            raise self.refused("", f"must be a table, not {shown(self.keys)}")

    def __str__(self) -> str:
        *names, last = self.place
        if isinstance(last, int):
            return f"[[{'.'.join(map(str, names))}]] number {last + 1}"
        return f"[{'.'.join(map(str, self.place))}]"

    def error(self, message: str, *keys: str | int) -> ProfileError:
        """Return an error with the file, a message, and the line of a key or of the table."""
        line = line_of(self.text, (*self.place, *keys))
        return ProfileError(f"{self.path}, line {line}: {message}.")

    def refused(self, key: str, text: str, *within: str) -> ProfileError:
        """Return an error about a key, or an entry within it; "" for the table itself.

        `text` is the end of a sentence that begins with the key and its table.
        """
        if not key:
            return self.error(f"{self} {text}")
        return self.error(f"{key} of {self} {text}", key, *within)

    def table(self, *names: str) -> Table:
        """Return a nested table, which is empty if the file does not have it."""
        keys = self.keys
        for name in names:
            keys = keys.get(name, {})
        return replace(self, place=(*self.place, *names), keys=keys)

    def named(self) -> dict[str, Table]:
        """Return the nested tables, keyed by name; refuse invalid names."""
        if len(self.keys) > _MOST_NAMED:
            text = f"must have at most {_MOST_NAMED} tables, not {len(self.keys)}"
            raise self.refused("", text)
        for name in self.keys:
            if _NAME.fullmatch(name) is None:
                text = "must begin with a letter and have at most 32 letters, digits, '_' and '-'"
                raise self.error(f"the name {name!r} {text}", name)
        return {name: self.table(name) for name in self.keys}

    def chosen(self, key: str, names: Iterable[str]) -> str:
        """Return the value of a key, which must be one of `names`."""
        kind = inspect.LiteralType(tuple(names))
        if self.keys.get(key) not in kind.values:
            raise self._unfit(key, kind)
        return self.keys[key]

    def decode(
        self,
        *kinds: type,
        given: Mapping[str, Any] | None = None,
        drivers: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> list[Any]:
        """Return one value of each Struct or dataclass, whose fields are the keys of the table.

        `given` are fields that are not keys of the table. `drivers` are the chips from which a key
        of the table selects; the error about an unknown key names the chips that have it.
        """
        given = given or {}
        known = {n: one for kind in kinds for n, one in fields_of(kind).items() if n not in given}
        for name in (one for one in self.keys if one not in known):
            for key, chips in (drivers or {}).items():
                having = [repr(one) for one in chips if name in fields_of(chips[one].keys)]
                if having:
                    text = f"{name!r} belongs to {key} = {' or '.join(having)}, not to {self}"
                    raise self.error(text, name)
            raise self.error(f"{self} has no key {choice(name, known)}", name)
        for name, one in known.items():
            if one.required and name not in self.keys:
                raise self._unfit(name, one.type)
        found: list[Any] = []
        for kind in kinds:
            try:
                found.append(msgspec.convert({**self.keys, **given}, kind, dec_hook=_pin))
            except msgspec.ValidationError as error:
                cause = error.__cause__
                if isinstance(cause, KeyMistake):
                    raise self.refused(cause.key, str(cause)) from None
                key = _PATH.findall(str(error))[0]  # Missing keys were found before.
                raise self._unfit(key, fields_of(kind)[key].type, str(cause or "")) from None
        self.decoded.extend((self, keys) for keys in found if isinstance(keys, Keys))
        return found

    def _unfit(self, key: str, kind: inspect.Type, why: str = "") -> ProfileError:
        """Return an error about a key that is missing, or whose type does not permit its value."""
        if key not in self.keys:
            return self.refused("", f"lacks the key {key!r}, {permitted(kind)}")
        value = self.keys[key]
        why = why or f"not {shown(value)}"
        if isinstance(kind, inspect.LiteralType) and isinstance(value, str):
            why += _nearest(value, [*map(str, kind.values)])
        return self.refused(key, f"must be {permitted(kind)}, {why}")
