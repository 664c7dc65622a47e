"""systemd unit of a robot, which starts it with the computer and keeps its pins safe."""

from __future__ import annotations

import getpass
import re
import shutil
import sys
from pathlib import Path
from typing import Final

from shapechanger.errors import OutputError
from shapechanger.files import write_new

_TEMPLATE: Final = Path(__file__).parent / "robot.service"
_NOT_IN_UNITS: Final = re.compile(r"[^A-Za-z0-9_.-]")
_PLAIN_WORD: Final = re.compile(r"[A-Za-z0-9_./+:@,=-]+")
_ESCAPES: Final = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "%": "%%", "$": "$$"}


def unit_name(robot: str) -> str:
    """Return the name of a robot's systemd unit; one computer may serve several robots."""
    return f"shapechanger-{_NOT_IN_UNITS.sub('-', robot)}.service"


def unit_word(text: str) -> str:
    """Return a word of a command line, in quotes if it needs them (systemd.service(5))."""
    if _PLAIN_WORD.fullmatch(text):
        return text
    return f'"{"".join(_ESCAPES.get(character, character) for character in text)}"'


def unit_text(
    robot: str, profile: Path, program: str, user: str, credentials: Path | None = None
) -> str:
    """Return the text of the unit for a profile.

    Args:
        robot: Name of the robot.
        profile: Its profile.
        program: Path of the command `shapechanger`.
        user: User that runs it, a member of the groups of its devices.
        credentials: Folder of the key and the certificate; None for the default.
    """
    text = _TEMPLATE.read_text(encoding="utf-8")
    values = {
        "UNIT": unit_name(robot).removesuffix(".service"),
        "ROBOT": _NOT_IN_UNITS.sub("-", robot),
        "PROFILE": unit_word(str(profile)),
        "PROGRAM": unit_word(program),
        "USER": user,
        "OPTIONS": f" --credentials {unit_word(str(credentials))}" if credentials else "",
    }
    # At once, because a path may hold what looks like another placeholder.
    return re.sub("@([A-Z]+)@", lambda match: values[match[1]], text)


def write_unit(
    robot: str, profile: Path, credentials: Path | None = None, user: str = ""
) -> tuple[Path, bool]:
    """Write the unit next to a profile; an existing file stays.

    Args:
        robot: Name of the robot.
        profile: Its profile, which need not exist yet.
        credentials: Folder of its key and certificate; None for the default.
        user: User that runs it; "" for the one of this process.

    Returns:
        The file, and True if it was written now.
    """
    path = profile.absolute().parent / unit_name(robot)
    program = shutil.which("shapechanger") or f"{sys.prefix}/bin/shapechanger"
    folder = credentials.absolute() if credentials else None
    text = unit_text(robot, profile.absolute(), program, user or getpass.getuser(), folder)
    try:
        write_new(path, text.encode())
    except FileExistsError:
        return path, False
    except OSError as error:
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
    return path, True
