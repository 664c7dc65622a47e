"""Tables of the keys of profiles and of messages, made from the types that decode them.

A page has a comment in the place of each, such as `<!-- keys: profile limits -->`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from inspect import cleandoc
from typing import Any, Final

import msgspec
from msgspec import inspect

from shapechanger.robot.drivers.chip import Keys
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.link.messages import ClientMessage, RobotMessage
from shapechanger.robot.profile.profile import QUANTITIES, RobotTable
from shapechanger.robot.profile.read import DRIVERS, GIVEN, TABLES
from shapechanger.robot.profile.toml import fields_of, permitted

_MARK: Final = re.compile(r"^<!-- keys: (\w+) (\w+) -->$", re.MULTILINE)


def with_keys(markdown: str) -> str:
    """Return a page with a table of keys in the place of each of its comments."""
    made = {"profile": _profile_table, "messages": _messages}
    return _MARK.sub(lambda mark: "\n\n".join(made[mark[1]](mark[2])), markdown)


def _profile_table(name: str) -> Iterator[str]:
    """Return the keys of a table of a profile, and of each driver that it may name."""
    chosen = DRIVERS.get(name, {})
    yield from _keys(*TABLES[name], options=chosen)
    for choosing, chips in chosen.items():
        for driver, chip in chips.items():
            yield f'#### `{choosing} = "{driver}"`'
            keys = chip.keys
            yield _summary(keys) if keys is not Keys else "It has no more keys."
            if quantities := [
                f"`{quantity}` ({unit})" if unit != "1" else f"`{quantity}`"
                for quantity, (unit, _, _, measures) in QUANTITIES.items()
                if measures == getattr(chip, "measures", "")
            ]:
                yield f"It measures {', '.join(quantities)}."
            yield from _keys(keys, options=chosen)
            if rows := getattr(chip, "rows", None):
                yield f"Keys of each table `[{name}.NAME.JOINT]`:"
                yield from _keys(rows)


def _messages(side: str) -> Iterator[str]:
    """Return the messages of one side, the client's or the robot's."""
    for kind in {"client": ClientMessage, "robot": RobotMessage}[side].__subclasses__():
        yield f"#### `{kind.__struct_config__.tag}`"
        yield _summary(kind)
        yield from _keys(kind, typed=True)


def _keys(
    *kinds: type, typed: bool = False, options: Mapping[str, Iterable[str]] | None = None
) -> Iterator[str]:
    """Return a table of the fields of some types, if they have any.

    `typed` is for messages, whose values have the types of MessagePack; `options` are the names
    that a key can have as its value.
    """
    rows: list[str] = []
    for kind in kinds:
        for name, field in fields_of(kind).items():
            if not typed and name in GIVEN and kind is not RobotTable:
                continue
            meaning = _meanings(kind).get(name, "")
            if typed:
                values, meaning = _types(field.type), meaning.replace("None", "null")
            else:
                names = (options or {}).get(name)
                one = inspect.LiteralType(tuple(names)) if names else field.type
                values = permitted(one).replace(Pin.description, "a pin").replace("'", '"')
                meaning = _NONE.sub("", meaning)
            rows.append(f"| `{name}` | {values} | {_default(name, field)} | {meaning} |")
    if rows:
        yield "\n".join(["| Key | Values | Default | Meaning |", "|---|---|---|---|", *rows])


# A default of None is no key at all.
_NONE: Final = re.compile(r"; None [^.;]*")


def _default(name: str, field: inspect.Field) -> str:
    """Return a default as a cell; empty for a required key."""
    value: Any = field.default
    if value is None:
        return "none"
    if value is msgspec.NODEFAULT or value in ("", ()):
        return ""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if name in ("address", "mux"):
        return hex(value)
    if isinstance(value, int | float):
        return f"{value:.9g}"
    return str([*value])


_TYPES: Final = {
    inspect.IntType: "integer",
    inspect.FloatType: "number",
    inspect.StrType: "text",
    inspect.BytesType: "bytes",
    inspect.BoolType: "true or false",
    inspect.NoneType: "null",
    inspect.DictType: "map",
    inspect.StructType: "map",
}


def _types(kind: inspect.Type) -> str:
    """Return the types of MessagePack that a field of a message may have."""
    match kind:
        case inspect.UnionType():
            return " or ".join(map(_types, kind.types))
        case inspect.LiteralType():
            return " or ".join(f'"{value}"' for value in kind.values)
        case inspect.VarTupleType() | inspect.ListType():
            return f"array of {_types(kind.item_type)}"
        case inspect.TupleType():
            return f"array of {' and '.join(map(_types, kind.item_types))}"
        case _:
            return _TYPES[type(kind)]


def _sections(kind: type) -> list[tuple[str, Any]]:
    """Return the kind and the content of each part of the docstring of a class."""
    import griffe  # Part of the tools for the site.

    doc = griffe.Docstring(cleandoc(kind.__doc__ or ""))
    return [(one.kind.value, one.value) for one in griffe.parse_google(doc, warnings=False)]


def _summary(kind: type) -> str:
    """Return what a docstring says before the attributes."""
    return _cell(" ".join(value for part, value in _sections(kind) if part == "text"))


def _meanings(kind: type) -> dict[str, str]:
    """Return the meaning of each key, from the docstrings of a class and of its bases."""
    return {
        attribute.name: _cell(attribute.description)
        for base in reversed(kind.__mro__)
        for part, value in _sections(base)
        if part == "attributes"
        for attribute in value
    }


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")
