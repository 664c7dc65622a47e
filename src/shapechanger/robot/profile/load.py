"""Find, read, create and change profile files."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from shapechanger.errors import (
    OutputError,
    ProfileError,
    UnknownName,
    require_known,
    translate_errors,
)
from shapechanger.files import cannot_write, write_atomic, write_new
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.profile.read import read_profile

_SHIPPED: Final = Path(__file__).parent / "shipped"
_SUFFIX: Final = ".toml"
_LARGEST: Final = 1024 * 1024  # Size of the largest profile, bytes.
_MOST_LISTED: Final = 40

CAMERAS: Final = {"ribbon": "picamera2", "usb": "v4l2", "none": ""}
"""Driver of each kind of camera that a new profile can have."""


def shipped_profiles() -> dict[str, Path]:
    """Return the files of the profiles that ship with the package, keyed by name."""
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
    """Read the text of a profile."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST + 1)
        # Newlines are converted as in `tomllib.load`; Windows editors may prepend a byte-order
        # mark.
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError as error:
        known = dict.fromkeys(shipped_profiles(), " of Shapechanger")
        here = sorted(path.parent.glob(f"*{_SUFFIX}"))
        known |= {file.stem: f" in {path.parent}" for file in here}
        close = difflib.get_close_matches(path.stem, known, n=1)
        near = f" (did you mean {close[0]}{known[close[0]]}?)" if close else ""
        listed = ", ".join([*known][:_MOST_LISTED])
        raise ProfileError(f"There is no file {path}{near}; there are: {listed}.") from error
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ProfileError(f"{path}, line {line}: this is not UTF-8 text.") from error
    except (OSError, ValueError) as error:  # ValueError: NUL in the path.
        message = getattr(error, "strerror", None) or error
        raise ProfileError(f"{path} cannot be read: {message}.") from error
    if len(data) > _LARGEST:
        raise ProfileError(f"{path} is longer than a profile can be, 1 MiB.")
    return text


def starter_text(
    kind: str, path: str | os.PathLike[str], robot_name: str, camera: str = "", arming: str = ""
) -> str:
    """Return the text of a new profile, with the checks of `write_profile`, without writing it."""
    import tomlkit  # Only writing profiles needs it.

    shipped = shipped_profiles()
    require_known("kind of robot", shipped, kind)
    if camera and camera not in CAMERAS:
        raise UnknownName("camera", camera, CAMERAS)
    document: Any = tomlkit.parse(profile_text(shipped[kind]))
    document["robot"]["name"] = robot_name
    before: Any = document.get("camera", {})
    driver = CAMERAS.get(camera, before.get("driver", ""))
    if not driver:
        document.pop("camera", None)
        document.get("limits", {}).pop("camera_stale_ms", None)
    elif driver != before.get("driver"):
        table: Any = tomlkit.table()
        table["driver"] = driver
        # The other settings are specific to the previous camera.
        table.update({key: before[key] for key in ("size", "fps") if key in before})
        table.add(tomlkit.nl())
        document["camera"] = table
    if arming:
        document.setdefault("limits", tomlkit.table())["arming"] = arming
    text = tomlkit.dumps(document)
    read_profile(text, Path(path))
    if os.path.lexists(path):
        raise OutputError(f"Cannot write {path}: it exists.")
    return text


def write_profile(
    kind: str, path: str | os.PathLike[str], robot_name: str, camera: str = "", arming: str = ""
) -> Path:
    """Copy a shipped profile under a new name, creating missing folders, and return its file.

    Args:
        kind: Name of a shipped profile, such as "car".
        path: The new file, which must not exist.
        robot_name: Name of the new robot.
        camera: A key of `CAMERAS`; "" for the camera of the shipped profile.
        arming: "person" or "anyone"; "" for the setting of the shipped profile.

    Raises:
        UnknownName: If there is no shipped profile or no camera of this name.
        ProfileError: If the robot's name or `arming` is invalid.
        OutputError: If the file exists or cannot be written; no partial file is left.
    """
    path = Path(path)
    text = starter_text(kind, path, robot_name, camera, arming)
    with translate_errors(OSError, to=lambda error: cannot_write(path, error)):
        write_new(path, text.encode())
    return path


def rewrite(path: str | os.PathLike[str], changes: Mapping[str, Any]) -> Profile:
    """Change values, or add keys to existing tables, atomically, and return the new profile.

    Comments, order and blank lines are kept.

    Args:
        path: The file; a symbolic link is followed.
        changes: New values, keyed by dotted name, such as `output.steering.centre_us`.

    Raises:
        ProfileError: If the file is not a valid profile, before or after the change.
        UnknownName: If a table is not in the file.
        OutputError: If the file cannot be written; it is then unchanged.
    """
    import tomlkit  # Only writing profiles needs it.

    target = Path(path).resolve()
    before = profile_text(target)
    read_profile(before, target)
    document: Any = tomlkit.parse(before)
    for dotted, value in changes.items():
        *tables, key = dotted.split(".")
        table: Any = document
        for name in tables:
            known = [k for k, v in table.items() if isinstance(v, dict)]
            require_known(f"table of {target.name}", known, name)
            table = table[name]
        if isinstance(value, dict):
            entries: Any = tomlkit.inline_table()
            entries.update(value)
            table[key] = entries
        else:
            table[key] = value
    text = tomlkit.dumps(document)
    profile = read_profile(text, target)
    write_atomic(target, text.encode())
    return profile
