"""Finds and reads the file of a profile."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Final

from shapechanger.errors import OutputError, ProfileError, UnknownName
from shapechanger.robot.new_file import write_new
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.profile.read import read_profile

__all__ = [
    "find_profile",
    "load_profile",
    "profile_text",
    "shipped_profiles",
    "starter_text",
    "write_profile",
]

_SHIPPED: Final = Path(__file__).parent / "shipped"
_SUFFIX: Final = ".toml"
_LARGEST: Final = 1024 * 1024  # Bytes; a longer file is something else.


def shipped_profiles() -> dict[str, Path]:
    """The profiles that come with the package: their names and files."""
    return {path.stem: path for path in sorted(_SHIPPED.glob(f"*{_SUFFIX}"), key=lambda p: p.stem)}


def find_profile(name_or_path: str | os.PathLike[str]) -> Path:
    """The file of a profile.

    Args:
        name_or_path: Name of a shipped profile, such as "car"; or else of one in the current
            folder, "my-car" for my-car.toml; or a path, which is returned as it is.

    Raises:
        UnknownName: If it is neither such a name nor looks like a path.
    """
    text = os.fspath(name_or_path)
    path = Path(text)
    if path.suffix == _SUFFIX or path.name != text:
        return path
    shipped = shipped_profiles()
    if text not in shipped:
        here = Path(f"{text}{_SUFFIX}")
        if here.is_file():
            return here
        raise UnknownName("profile", text, shipped)
    return shipped[text]


def load_profile(path: str | os.PathLike[str]) -> Profile:
    """The profile in a file.

    Raises:
        ProfileError: If the file cannot be read, or is no profile.
    """
    return read_profile(profile_text(path), Path(path))


def profile_text(path: str | os.PathLike[str]) -> str:
    """The text of a profile.

    Raises:
        ProfileError: If the file is not there, cannot be read, or is no text.
    """
    try:
        with Path(path).open("rb") as file:
            data = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise ProfileError(f"There is no file {os.fspath(path)}.") from None
    except IsADirectoryError:
        raise ProfileError(f"{os.fspath(path)} is a folder, not a profile.") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path.
        reason = getattr(error, "strerror", None) or error
        raise ProfileError(f"{os.fspath(path)} cannot be read: {reason}.") from error
    if len(data) > _LARGEST:
        raise ProfileError(f"{os.fspath(path)} is longer than a profile can be, 1 MiB.")
    try:
        # As tomllib does for a file; a text editor of Windows may put a mark at the start.
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ProfileError(f"{os.fspath(path)}, line {line}: this is no UTF-8 text.") from None


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
