"""Atomic writing of files."""

from __future__ import annotations

import os
from pathlib import Path


def write_new(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Write a new file completely or not at all; a missing folder is made.

    Args:
        path: The file.
        data: Content of the file.
        mode: Permissions from the start, reduced by the process's umask.

    Raises:
        FileExistsError: If the file exists.
        OSError: If it cannot be written; no partial file is left.
    """
    if os.path.lexists(path):
        raise FileExistsError(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(path, data, mode)


def rewrite_file(path: Path, data: bytes) -> None:
    """Replace the content of a file atomically, safe against a power failure.

    Args:
        path: The file, whose permissions are kept.
        data: Its new content.

    Raises:
        OSError: If it cannot be written; it is then unchanged, and no partial file is left.
    """
    _write(path, data, path.stat().st_mode & 0o7777, keeps_mode=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _write(path: Path, data: bytes, mode: int, *, keeps_mode: bool = False) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        # O_EXCL and the mode from the start keep other users from reading it meanwhile.
        fd = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        with os.fdopen(fd, "wb") as file:
            if keeps_mode:
                os.fchmod(fd, mode)  # The umask does not apply.
            file.write(data)
            file.flush()
            os.fsync(fd)
        partial.rename(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise
