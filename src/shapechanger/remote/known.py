"""The robots that a workstation knows, one file each.

They are in `~/.config/shapechanger/known/NAME.toml` (below `$XDG_CONFIG_HOME` where that is set),
which only their owner may read, because they hold the key.
"""

from __future__ import annotations

import json
import os
import re
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.errors import LinkError, OutputError, UnknownName
from shapechanger.link.address import parse_address
from shapechanger.link.proof import parse_key
from shapechanger.remote.trust import INSECURE, parse_trust

__all__ = [
    "KnownRobot",
    "check_name",
    "forget",
    "known_folder",
    "known_names",
    "recall",
    "remember",
]

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_FIELDS: Final = ("address", "key", "fingerprint")
_OTHERS: Final = 0o077


def check_name(name: str) -> None:
    """Refuse a name that no robot can be remembered under.

    Raises:
        LinkError: If it is none.
    """
    if not _NAME.fullmatch(name):
        raise LinkError(
            f"{name!r} is no name for a robot: up to 64 letters, digits, '-', '_' and '.'."
        )


@dataclass(frozen=True, slots=True)
class KnownRobot:
    """What it takes to reach a robot.

    Attributes:
        name: Name of the robot.
        address: Host, or HOST:PORT.
        key: The robot's key, as its `init` wrote it.
        fingerprint: SHA-256 of its certificate in hexadecimal, or "insecure"; then the key may be
            empty.

    Raises:
        LinkError: If one of them cannot be meant.
    """

    name: str
    address: str
    key: str
    fingerprint: str

    def __post_init__(self) -> None:
        check_name(self.name)
        parse_address(self.address)
        parse_trust(self.fingerprint)
        if self.key or self.fingerprint != INSECURE:
            parse_key(self.key)

    def __repr__(self) -> str:
        """Without the key, which belongs in no log."""
        return f"KnownRobot({self.name!r}, {self.address!r}, fingerprint={self.fingerprint!r})"


def known_folder() -> Path:
    """Where they are."""
    config = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return Path(config) / "shapechanger" / "known"


def known_names() -> tuple[str, ...]:
    """The names of all robots that are remembered, in order."""
    return tuple(sorted(path.stem for path in known_folder().glob("*.toml")))


def remember(robot: KnownRobot) -> Path:
    """Write a robot down; one of the same name is replaced.

    Returns:
        The file.

    Raises:
        OutputError: If it cannot be written; it is then as it was.
    """
    folder = known_folder()
    # The strings of JSON are strings of TOML, but for one character, which no field holds.
    lines = [
        f"{field} = {json.dumps(getattr(robot, field), ensure_ascii=False)}\n" for field in _FIELDS
    ]
    path = folder / f"{robot.name}.toml"
    written: Path | None = None
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        # A temporary file is made for its owner alone.
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=folder, delete=False) as file:
            written = Path(file.name)
            file.writelines(lines)
        written.replace(path)
    except OSError as error:
        if written is not None:
            written.unlink(missing_ok=True)
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from None
    return path


def recall(name: str) -> KnownRobot:
    """A robot that was remembered.

    Raises:
        UnknownName: If there is none of this name.
        LinkError: If its file cannot be read, or others can read it too.
    """
    path = known_folder() / f"{name}.toml"
    if name not in known_names():
        raise UnknownName("known robot", name, known_names())
    if os.name == "posix" and path.stat().st_mode & _OTHERS:
        raise LinkError(f"Others may read the key in {path}: run `chmod 600 {path}`.")
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise LinkError(f"{path} cannot be read: {error}.") from None
    if set(told) != set(_FIELDS) or not all(isinstance(value, str) for value in told.values()):
        raise LinkError(f"{path} must hold {', '.join(_FIELDS)}, each a text.")
    return KnownRobot(name, **told)


def forget(name: str) -> None:
    """Remove a robot.

    Raises:
        UnknownName: If there is none of this name.
    """
    if name not in known_names():
        raise UnknownName("known robot", name, known_names())
    (known_folder() / f"{name}.toml").unlink()
