"""Atomic writing of new files."""

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
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        # O_EXCL and the mode from the start keep other users from reading it meanwhile.
        fd = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        with os.fdopen(fd, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(fd)
        partial.rename(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise
