"""File names of an episode, and how its files are locked and written."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import stat
from pathlib import Path
from typing import Final

from shapechanger.errors import DemosError, OutputError
from shapechanger.files import writing

HEADER: Final = "episode.json"
STEPS: Final = "steps.jsonl"
FRAMES: Final = "frames"
LOST: Final = "lost"

MAX_TEXT_BYTES: Final = 256 << 20
"""Largest text file to read, bytes. An hour of steps has 30 MB in a car and 200 MB in a finger."""

FULL_BYTES: Final = MAX_TEXT_BYTES * 3 // 4
"""Size of `steps.jsonl` from which recorders begin the next episode, bytes; marks and edits, which
come later, have the rest."""

MAX_PICTURE_BYTES: Final = 16 << 20
"""Largest image to write or read, bytes."""

_MOST_OF_A_NAME: Final = 9999


def is_episode(folder: Path) -> bool:
    """Return whether `folder` contains an episode."""
    return (folder / HEADER).is_file() or (folder / STEPS).is_file()


def read_file(path: Path, most: int) -> bytes:
    """Return the content of a regular file, which may come from a stranger.

    Args:
        path: The file; a pipe or a device, which may never end, is refused unread.
        most: Largest size to read, bytes.

    Raises:
        OSError: If it cannot be read, is not a regular file, or is larger.
    """
    # Not blocking, because a pipe without a writer would otherwise block before it can be examined.
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    with open(fd, "rb") as file:
        found = os.fstat(fd)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "it is not a regular file")
        if found.st_size > most:
            raise OSError(
                errno.EFBIG, f"it has {found.st_size} bytes, more than the limit of {most}"
            )
        return file.read(found.st_size)


def free_path(folder: Path, stem: str, ending: str = "") -> Path:
    """Return a path in `folder` that does not exist, with the next free number where needed."""
    path = folder / f"{stem}{ending}"
    counted = re.fullmatch(r"(.*)-([0-9]{4})", stem, re.DOTALL)
    begun, number = (counted[1], int(counted[2])) if counted else (stem, 0)
    if number == _MOST_OF_A_NAME:  # The next number would have five digits.
        begun, number = stem, 0
    while os.path.lexists(path):
        if (number := number + 1) > _MOST_OF_A_NAME:
            raise OutputError(f"{folder} has too many files with names like {stem}{ending}.")
        path = folder / f"{begun}-{number:04d}{ending}"
    return path


def lock(path: Path, busy: str) -> int:
    """Lock a file until its descriptor is closed; create the file if it is missing.

    Args:
        path: The file.
        busy: Error message if another process holds the lock.

    Returns:
        A file descriptor, open for appending.

    Raises:
        DemosError: If another process holds the lock.
        OutputError: If the file cannot be opened for writing.
    """
    with writing(path):
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(fd)
            if isinstance(error, BlockingIOError):
                raise DemosError(busy) from None
            raise
    return fd


def write_all(fd: int, data: bytes) -> None:
    """Append to a file completely, or leave the file as it was.

    Args:
        fd: Descriptor of the file.
        data: The bytes to append.

    Raises:
        OSError: If the data cannot be written.
    """
    before = os.fstat(fd).st_size
    try:
        written = 0
        while written < len(data):
            written += os.write(fd, data[written:])
    except OSError:
        os.ftruncate(fd, before)
        raise
