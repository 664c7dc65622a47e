"""Reads one table of a profile: knows all of its keys, or says which one it does not."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, cast

from shapechanger.robot.profile.keys import REQUIRED, Key
from shapechanger.robot.profile.lines import Place
from shapechanger.robot.profile.mistake import Source, called, choice, shown
from shapechanger.robot.profile.units import unit_of, with_unit

__all__ = ["read_key", "read_keys", "refuse_bad_name", "refuse_unknown_keys", "table_at"]


_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")


def table_at(source: Source, data: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The table of this name in another one; empty where there is none.

    Raises:
        ProfileError: If it is something else.
    """
    found = data.get(str(place[-1]), {})
    if not isinstance(found, dict):
        what = shown(found)
        raise source.mistake(place, f"{called(place)} must be a table, not {what}")
    return cast("dict[str, Any]", found)


def read_keys(
    source: Source, table: Mapping[str, Any], place: Place, keys: Iterable[Key]
) -> dict[str, Any]:
    """The value of each key, those with their default too.

    Raises:
        ProfileError: If one is missing, or is not what it may be.
    """
    return {key.name: read_key(source, table, place, key) for key in keys}


def read_key(source: Source, table: Mapping[str, Any], place: Place, key: Key) -> Any:
    """The value of a key, or its default.

    Raises:
        ProfileError: If it is missing, or is not what it may be.
    """
    if key.name not in table:
        if key.default is REQUIRED:
            words = f"{called(place)} lacks the key {key.name!r}, {key.wanted}"
            raise source.mistake(place, words)
        return key.default
    written = table[key.name]
    try:
        return key.value_of(written)
    except ValueError as error:
        words = f"{key.name} of {called(place)} must be {key.wanted}, {error}"
        raise source.mistake((*place, key.name), words) from None


def refuse_bad_name(source: Source, place: Place) -> None:
    """Refuse a table whose own name, the last of its place, is none for a part of a robot.

    Raises:
        ProfileError: If it is none.
    """
    name = str(place[-1])
    if _NAME.fullmatch(name) is None:
        words = (
            f"the name {name!r} must begin with a letter and have at most 32 letters, digits, "
            "'_' and '-'"
        )
        raise source.mistake(place, words)


def refuse_unknown_keys(
    source: Source,
    table: Mapping[str, Any],
    place: Place,
    known: Iterable[str],
    elsewhere: Mapping[str, str] | None = None,
) -> None:
    """Refuse a key that nobody would read.

    Args:
        source: Where the table was read.
        table: The table.
        place: Its place.
        known: The keys that it may have.
        elsewhere: Where other keys belong, in words.

    Raises:
        ProfileError: If there is one; says which key with a unit is meant, where it belongs, or
            what there is.
    """
    names = tuple(known)
    for name in table:
        if name in names:
            continue
        if (meant := with_unit(name, names)) is not None:
            raise _unit_is_missing(source, place, name, meant)
        if elsewhere and name in elsewhere:
            words = f"{name!r} belongs to {elsewhere[name]}, not to {called(place)}"
        else:
            words = f"{called(place)} has no key {choice(name, names)}"
        raise source.mistake((*place, name), words)


def _unit_is_missing(source: Source, place: Place, name: str, meant: str) -> Exception:
    what = f"{name!r} of {called(place)} lacks its unit or has another one"
    return source.mistake((*place, name), f"{what}: write {meant!r} ({unit_of(meant)})")
