"""Where the lines of a file that grows begin, so that each is found without reading the others."""

from __future__ import annotations

import os
from array import array
from pathlib import Path
from typing import BinaryIO, Final

__all__ = ["LineIndex"]

_CHUNK: Final = 1 << 16


class LineIndex:
    r"""The complete lines of a file: those that end with `\n`.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # Where each complete line ends; 8 bytes a line.
        self._ends: array[int] = array("Q")
        self._read_to = 0
        self._inode = -1

    def __len__(self) -> int:
        """How many complete lines were there at the last `refresh`."""
        return len(self._ends)

    def refresh(self, file: BinaryIO) -> None:
        """Look at what has come since; from the beginning, if the file is another or shorter one.

        Args:
            file: The file, open for reading.

        Raises:
            OSError: If it cannot be read.
        """
        found = os.fstat(file.fileno())
        if found.st_ino != self._inode or found.st_size < self._read_to:
            self._ends, self._read_to, self._inode = array("Q"), 0, found.st_ino
        file.seek(self._read_to)
        while chunk := file.read(_CHUNK):
            at = -1
            while (at := chunk.find(b"\n", at + 1)) != -1:
                self._ends.append(self._read_to + at + 1)
            self._read_to += len(chunk)

    def begins(self, number: int) -> int:
        """Where a line begins, in bytes."""
        return self._ends[number - 1] if number else 0

    def read(self, file: BinaryIO, number: int) -> bytes:
        r"""A line with its `\n`.

        Raises:
            OSError: If it cannot be read.
        """
        began = self.begins(number)
        file.seek(began)
        return file.read(self._ends[number] - began)
