"""The systemd unit of a robot: starts it with the computer, and leaves its pins safe."""

from __future__ import annotations

import getpass
import shutil
import sys
from pathlib import Path
from typing import Final

from shapechanger.errors import OutputError
from shapechanger.robot.setup.doctor import UNIT

__all__ = ["unit_text", "write_unit"]

_TEMPLATE: Final = Path(__file__).parent / UNIT


def unit_text(profile: Path, program: str, user: str) -> str:
    """The unit for a profile.

    Args:
        profile: The robot's profile.
        program: The command `shapechanger`, with its folder.
        user: Who runs it; a member of the groups gpio, i2c and video.
    """
    text = _TEMPLATE.read_text(encoding="utf-8")
    for name, value in (("PROFILE", str(profile)), ("PROGRAM", program), ("USER", user)):
        text = text.replace(f"@{name}@", value)
    return text


def write_unit(profile: Path) -> tuple[Path, bool]:
    """Write the unit beside a profile; one that is there already stays.

    Returns:
        The file, and whether it was written.

    Raises:
        OutputError: If it cannot be written.
    """
    path = profile.absolute().parent / UNIT
    program = shutil.which("shapechanger") or f"{sys.prefix}/bin/shapechanger"
    text = unit_text(profile.absolute(), program, getpass.getuser())
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        return path, False
    except OSError as error:
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
    return path, True
