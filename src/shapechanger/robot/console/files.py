"""The files of the console, read once and held in memory: they are few and small."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.errors import RobotError

__all__ = ["ENTRY", "ConsoleFile", "console_files"]

ENTRY: Final = "index.html"
"""Name of the page itself."""

_FOLDER: Final = Path(__file__).parent
# What a browser may be given; a file of any other kind in the folder stays there.
_KINDS: Final = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True, slots=True)
class ConsoleFile:
    """A file as it goes to a browser.

    Attributes:
        content_type: Its media type; the text is UTF-8.
        body: Its bytes.
    """

    content_type: str
    body: bytes


def console_files(folder: Path = _FOLDER) -> dict[str, ConsoleFile]:
    """The files of the console by name.

    Raises:
        RobotError: If they cannot be read, as after an installation that went wrong.
    """
    try:
        files = {
            path.name: ConsoleFile(_KINDS[path.suffix], path.read_bytes())
            for path in sorted(folder.iterdir())
            if path.suffix in _KINDS
        }
    except OSError as error:
        raise RobotError(f"The console in {folder} cannot be read: {error}.") from error
    if ENTRY not in files:
        raise RobotError(f"There is no {ENTRY} in {folder}: install shapechanger again.")
    return files
