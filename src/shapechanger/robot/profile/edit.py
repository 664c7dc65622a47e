"""Edit values in a profile's file, keeping its comments, order and blank lines."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, cast

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


CAMERAS: Final = {"ribbon": "picamera2", "usb": "v4l2", "none": ""}
"""Driver of each kind of camera that `adapted` fits."""


def adapted(text: str, path: Path, camera: str = "", arming: str = "") -> str:
    """Return the text of a profile with another camera, or another rule of who may arm it.

    Args:
        text: The profile.
        path: Its file, for errors.
        camera: A key of `CAMERAS`; "" for the one that it has.
        arming: "person" or "anyone"; "" for the rule that it has.

    Raises:
        UnknownName: If there is no such camera.
        ProfileError: If the result is not a valid profile.
    """
    document: Any = tomlkit.parse(text)
    if camera:
        if camera not in CAMERAS:
            raise UnknownName("camera", camera, CAMERAS)
        before: Any = document.get("camera", {})
        if not CAMERAS[camera]:
            document.pop("camera", None)
            document.get("limits", {}).pop("camera_stale_ms", None)
        elif before.get("driver") != CAMERAS[camera]:
            table: Any = tomlkit.table()
            table["driver"] = CAMERAS[camera]
            # Other settings belong to the other camera.
            table.update({key: before[key] for key in ("size", "fps") if key in before})
            table.add(tomlkit.nl())
            document["camera"] = table
    if arming:
        document.setdefault("limits", tomlkit.table())["arming"] = arming
    result: str = tomlkit.dumps(document)
    read_profile(result, path)
    return result


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
