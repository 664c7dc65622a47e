"""Find, read and create profile files."""

from __future__ import annotations

import difflib
import json
import os
import re
from pathlib import Path
from typing import Final

from shapechanger.errors import OutputError, ProfileError, UnknownName
from shapechanger.robot.new_file import write_new
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.profile.read import read_profile

_SHIPPED: Final = Path(__file__).parent / "shipped"
_SUFFIX: Final = ".toml"
_LARGEST: Final = 1024 * 1024  # Size of the largest profile, bytes.
_MOST_LISTED: Final = 10


def shipped_profiles() -> dict[str, Path]:
    """Return the profiles that ship with the package: name to file."""
    return {path.stem: path for path in sorted(_SHIPPED.glob(f"*{_SUFFIX}"), key=lambda p: p.stem)}


def find_profile(name_or_path: str | os.PathLike[str]) -> Path:
    """Resolve the name or path of a profile.

    Args:
        name_or_path: Name of a shipped profile, such as "car"; name of one in the current folder,
            such as "my-car" for my-car.toml; or a path, which is returned unchanged.

    Raises:
        UnknownName: If it is neither a known name nor a path.
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
        stems = [file.stem for file in Path().glob(f"*{_SUFFIX}") if file.is_file()]
        raise UnknownName("profile", text, [*shipped, *difflib.get_close_matches(text, stems)])
    return shipped[text]


def load_profile(path: str | os.PathLike[str]) -> Profile:
    """Load a profile from a file.

    Raises:
        ProfileError: If the file cannot be read or is not a valid profile.
    """
    return read_profile(profile_text(path), Path(path))


def profile_text(path: str | os.PathLike[str]) -> str:
    """Read the text of a profile.

    Raises:
        ProfileError: If the file is missing, unreadable or not UTF-8.
    """
    try:
        with Path(path).open("rb") as file:
            data = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise ProfileError(f"There is no file {os.fspath(path)}{_nearest(Path(path))}") from None
    except IsADirectoryError:
        raise ProfileError(f"{os.fspath(path)} is a folder, not a profile.") from None
    except (OSError, ValueError) as error:  # ValueError: NUL in the path.
        reason = getattr(error, "strerror", None) or error
        raise ProfileError(f"{os.fspath(path)} cannot be read: {reason}.") from error
    if len(data) > _LARGEST:
        raise ProfileError(f"{os.fspath(path)} is longer than a profile can be, 1 MiB.")
    try:
        # Like tomllib for files; Windows editors may prepend a byte-order mark.
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ProfileError(f"{os.fspath(path)}, line {line}: this is not UTF-8 text.") from None


def _nearest(path: Path) -> str:
    """Return the end of a sentence about a missing profile: the nearest one, or its folder's."""
    there = sorted(file.stem for file in path.parent.glob(f"*{_SUFFIX}"))
    if close := difflib.get_close_matches(path.stem, there, n=1):
        return f"; did you mean {path.with_name(close[0] + _SUFFIX)}?"
    if close := difflib.get_close_matches(path.stem, shipped_profiles(), n=1):
        return f"; did you mean {close[0]}, which comes with Shapechanger?"
    listed = ", ".join(f"{name}{_SUFFIX}" for name in there[:_MOST_LISTED])
    return f"; its folder has {listed}." if there else "."


_NAME_LINE: Final = re.compile(r"^name = .*$", re.MULTILINE)


def starter_text(kind: str, path: str | os.PathLike[str], robot_name: str) -> str:
    """Return the text of a new profile, with the checks of `write_profile`, without writing it."""
    shipped = shipped_profiles()
    if kind not in shipped:
        raise UnknownName("kind of robot", kind, shipped)
    # JSON strings are TOML strings.
    name_line = f"name = {json.dumps(robot_name, ensure_ascii=False)}"
    text = _NAME_LINE.sub(lambda _: name_line, profile_text(shipped[kind]), count=1)
    target = Path(path)
    read_profile(text, target)
    if os.path.lexists(target):
        raise OutputError(f"Cannot write {target}: it exists.")
    return text


def write_profile(kind: str, path: str | os.PathLike[str], robot_name: str) -> Path:
    """Copy a shipped profile under a new name, creating missing folders, and return its file.

    Args:
        kind: Name of a shipped profile, such as "car".
        path: The new file, which must not exist.
        robot_name: Name of the new robot.

    Raises:
        UnknownName: If no shipped profile has this name.
        ProfileError: If the robot's name is invalid.
        OutputError: If the file exists or cannot be written; no partial file is left.
    """
    return write_text(Path(path), starter_text(kind, path, robot_name))


def write_text(path: Path, text: str) -> Path:
    """Write a new profile, creating missing folders, and return its file.

    Raises:
        OutputError: If the file exists or cannot be written; no partial file is left.
    """
    try:
        write_new(path, text.encode())
    except OSError as error:
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
    return path
