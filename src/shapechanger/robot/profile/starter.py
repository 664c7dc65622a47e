"""Writes a first profile for a new robot, from one that is shipped."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Final

from shapechanger.errors import OutputError, UnknownName
from shapechanger.robot.new_file import write_new
from shapechanger.robot.profile.load import profile_text, shipped_profiles
from shapechanger.robot.profile.read import read_profile

__all__ = ["starter_text", "write_profile"]

_NAME_LINE: Final = re.compile(r"^name = .*$", re.MULTILINE)


def starter_text(kind: str, path: str | os.PathLike[str], robot_name: str) -> str:
    """What `write_profile` would write; it refuses what that refuses, and writes nothing.

    Args:
        kind: Name of the shipped profile, such as "car".
        path: The file to write; it must not exist.
        robot_name: Name of the new robot.

    Raises:
        UnknownName: If no shipped profile has this name.
        ProfileError: If the robot's name cannot be one.
        OutputError: If the file exists.
    """
    shipped = shipped_profiles()
    if kind not in shipped:
        raise UnknownName("kind of robot", kind, shipped)
    # A text of JSON is a text of TOML too.
    name_line = f"name = {json.dumps(robot_name, ensure_ascii=False)}"
    text = _NAME_LINE.sub(lambda _: name_line, profile_text(shipped[kind]), count=1)
    target = Path(path)
    read_profile(text, target)
    if os.path.lexists(target):
        raise OutputError(f"Cannot write {target}: it exists.")
    return text


def write_profile(kind: str, path: str | os.PathLike[str], robot_name: str) -> Path:
    """Copy a shipped profile under a new name; folders that are missing are made.

    Args:
        kind: Name of the shipped profile, such as "car".
        path: The file to write; it must not exist.
        robot_name: Name of the new robot.

    Returns:
        The file.

    Raises:
        UnknownName: If no shipped profile has this name.
        ProfileError: If the robot's name cannot be one.
        OutputError: If the file exists, or cannot be written; nothing of it is left then.
    """
    target = Path(path)
    text = starter_text(kind, target, robot_name)
    try:
        write_new(target, text.encode())
    except OSError as error:
        raise OutputError(f"Cannot write {target}: {error.strerror or error}.") from error
    return target
