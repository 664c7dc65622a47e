"""Tables of the keys of profiles and of messages, made from the types that decode them.

A page has a comment in the place of each, such as `<!-- keys: profile limits -->`.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator
from datetime import date
from typing import Any, Final, get_args

import griffe
import msgspec

from shapechanger.robot.link.messages import ClientMessage, RobotMessage
from shapechanger.robot.profile.read import DRIVERS, GIVEN, TABLES
from shapechanger.robot.profile.toml import fields_of, keys_of, permitted

_MARK: Final = re.compile(r"^<!-- keys: (\w+) (\w+) -->$", re.MULTILINE)


def with_keys(markdown: str) -> str:
    """Return a page with a table of keys in the place of each of its comments."""
    made = {"profile": _profile_table, "messages": _messages}
    return _MARK.sub(lambda mark: "\n\n".join(made[mark[1]](mark[2])), markdown)


def _profile_table(name: str) -> Iterator[str]:
    """Return the keys of a table of a profile, and of each driver that it may name."""
    yield from _keys(*TABLES[name])
    for choosing, chips in DRIVERS.get(name, {}).items():
        for driver, chip in chips.items():
            yield f"#### `{choosing} = \"{driver}\"`"
            measured = f" It measures {chip.measures}." if hasattr(chip, "measures") else ""
            keys = keys_of(chip)
            yield f"{_summary(keys)}{measured}"
            yield from _keys(keys)
            if rows := getattr(chip, "rows", None):
                yield f"Keys of each table `[{name}.NAME.JOINT]`:"
                yield from _keys(rows)


def _messages(side: str) -> Iterator[str]:
    """Return the messages of one side, the client's or the robot's."""
    for kind in get_args({"client": ClientMessage, "robot": RobotMessage}[side]):
        yield f"#### `{msgspec.inspect.type_info(kind).tag}`"
        yield _summary(kind)
        yield from _keys(kind, typed=True)


def _keys(*kinds: type, typed: bool = False) -> Iterator[str]:
    rows = [
        f"| `{name}` | {_types(field.type) if typed else permitted(field.type)} "
        f"| {_default(field)} | {_meanings(kind)[name]} |"
        for kind in kinds
        for name, field in fields_of(kind).items()
        if typed or name not in GIVEN or kind is TABLES["robot"][0]
    ]
    if rows:
        yield "\n".join(["| Key | Values | Default | Meaning |", "|---|---|---|---|", *rows])


def _default(field: msgspec.inspect.Field) -> str:
    """Return a default as a cell; empty for a required key."""
    value: Any = field.default
    if field.required or field.default is msgspec.NODEFAULT or value in ("", ()):
        return ""
    if isinstance(value, bool | float | date | None):
        return {None: "none", math.inf: "no limit"}.get(value, f"{value}".lower())
    return f"`{value!r}`" if isinstance(value, str) else str(value)


_TYPES: Final = {
    msgspec.inspect.IntType: "integer",
    msgspec.inspect.FloatType: "number",
    msgspec.inspect.StrType: "text",
    msgspec.inspect.BytesType: "bytes",
    msgspec.inspect.BoolType: "true or false",
    msgspec.inspect.NoneType: "null",
    msgspec.inspect.DictType: "map",
    msgspec.inspect.StructType: "map",
}


def _types(kind: msgspec.inspect.Type) -> str:
    """Return the types of MessagePack that a field of a message may have."""
    match kind:
        case msgspec.inspect.UnionType():
            return " or ".join(map(_types, kind.types))
        case msgspec.inspect.LiteralType():
            return " or ".join(f'"{value}"' for value in kind.values)
        case msgspec.inspect.VarTupleType() | msgspec.inspect.ListType():
            return f"array of {_types(kind.item_type)}"
        case msgspec.inspect.TupleType():
            return f"array of {' and '.join(map(_types, kind.item_types))}"
        case _:
            return _TYPES[type(kind)]


def _sections(kind: type) -> list[Any]:
    """Return the parts of the docstring of a class."""
    return griffe.parse_google(griffe.Docstring(inspect.cleandoc(kind.__doc__ or "")), warnings=False)


def _summary(kind: type) -> str:
    """Return what a docstring says before the attributes."""
    texts = (s.value for s in _sections(kind) if s.kind is griffe.DocstringSectionKind.text)
    return _cell(" ".join(texts))


def _meanings(kind: type) -> dict[str, str]:
    """Return the meaning of each key, from the docstrings of a class and of its bases."""
    return {
        attribute.name: _cell(attribute.description)
        for base in reversed(kind.__mro__)
        for section in _sections(base)
        if section.kind is griffe.DocstringSectionKind.attributes
        for attribute in section.value
    }


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")
