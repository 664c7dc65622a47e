"""Edit values in a profile's file, keeping its comments, order and blank lines."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import tomlkit
from tomlkit.items import Item

from shapechanger.errors import OutputError, UnknownName
from shapechanger.robot.new_file import rewrite_file
from shapechanger.robot.profile.load import profile_text
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.profile.read import read_profile


def rewrite(path: str | os.PathLike[str], changes: Mapping[str, Any]) -> Profile:
    """Change values, or add keys to existing tables, atomically.

    Args:
        path: The file; a symbolic link is followed.
        changes: New values by dotted name, such as `output.steering.centre_us`.

    Returns:
        The profile after the change.

    Raises:
        ProfileError: If the file is not a valid profile, before or after the change.
        UnknownName: If a table is not in the file.
        OutputError: If the file cannot be written; it is then unchanged.
    """
    target = Path(path).resolve()
    before = profile_text(target)
    read_profile(before, target)
    document: Any = tomlkit.parse(before)
    for dotted, value in changes.items():
        *tables, key = dotted.split(".")
        table: Any = document
        for name in tables:
            known = [k for k, v in table.items() if isinstance(v, dict)]
            if name not in known:
                raise UnknownName(f"table of {target.name}", name, known)
            table = table[name]
        table[key] = _item(value, table, key)
    text: str = tomlkit.dumps(document)
    profile = read_profile(text, target)
    try:
        rewrite_file(target, text.encode())
    except OSError as error:
        raise OutputError(f"Cannot write {target}: {error.strerror or error}.") from error
    return profile


def _item(value: Any, table: Any, key: str) -> Any:
    """Convert a value for tomlkit; a table stays inline and keeps its trailing comment."""
    if not isinstance(value, dict):
        return value
    inline = tomlkit.inline_table()
    for name, entry in cast("dict[str, Any]", value).items():
        inline.append(name, entry)
    if isinstance(before := table.get(key), Item):
        inline.trivia.comment_ws = before.trivia.comment_ws
        inline.trivia.comment = before.trivia.comment
    return inline
