"""Writes a file that is whole or not there at all."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["write_new"]


def write_new(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Write a file that does not exist yet; its folder is made where it is missing.

    Args:
        path: The file.
        data: What goes into it.
        mode: Who may read it, from the start; less what the process's mask takes away.

    Raises:
        FileExistsError: If it exists.
        OSError: If it cannot be written; nothing of it is left then.
    """
    if os.path.lexists(path):
        raise FileExistsError(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        # With O_EXCL and the mode from the start, nobody can read it in between.
        fd = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        with os.fdopen(fd, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(fd)
        partial.rename(path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise
