"""Files of the console, read once and kept in memory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.errors import RobotError

ENTRY: Final = "index.html"
"""Name of the page."""

_FOLDER: Final = Path(__file__).parent
# Media types to serve; other files in the folder are not served.
_KINDS: Final = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True, slots=True)
class ConsoleFile:
    """File to send to a browser.

    Attributes:
        content_type: Media type; the text is UTF-8.
        body: Content of the file.
    """

    content_type: str
    body: bytes


def console_files(folder: Path = _FOLDER) -> dict[str, ConsoleFile]:
    """Read the console's files, by name.

    Raises:
        RobotError: If they cannot be read, as after a failed installation.
    """
    try:
        files = {
            path.name: ConsoleFile(_KINDS[path.suffix], path.read_bytes())
            for path in sorted(folder.iterdir())
            if path.suffix in _KINDS
        }
    except OSError as error:
        raise RobotError(f"Cannot read the console in {folder}: {error}.") from error
    if ENTRY not in files:
        raise RobotError(f"{folder} has no {ENTRY}: install shapechanger again.")
    return files
