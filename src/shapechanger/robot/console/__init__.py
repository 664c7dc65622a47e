"""Web page on which a person drives and records, and the loader of its files."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from shapechanger.errors import RobotError, translate_errors

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


def console_files(folder: Path = _FOLDER) -> dict[str, tuple[str, bytes]]:
    """Return the media type and the content (UTF-8) of each file of the console.

    Raises:
        RobotError: If they cannot be read, for example after a failed installation.
    """
    failed = f"Cannot read the console in {folder}"
    with translate_errors(OSError, to=lambda error: RobotError(f"{failed}: {error}.")):
        files = {
            path.name: (_KINDS[path.suffix], path.read_bytes())
            for path in sorted(folder.iterdir())
            if path.suffix in _KINDS
        }
    if ENTRY not in files:
        raise RobotError(f"{folder} has no {ENTRY}: install shapechanger again.")
    return files
