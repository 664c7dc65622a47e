"""Brings what was written to the disk itself, beside whoever writes."""

from __future__ import annotations

import contextlib
import os
import threading
from pathlib import Path
from typing import Final

__all__ = ["Syncer"]

_EVERY_S: Final = 1.0


class Syncer:
    """Once a second brings files to the disk, so that a power cut costs a second.

    A crash of the program costs nothing in any case: the kernel has the bytes then. It works in a
    thread, because a memory card may take longer for this than a control period.

    Args:
        fd: A file that grows; it stays open until `close`.
    """

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._waiting: list[Path] = []
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="episode sync", daemon=True)
        self._thread.start()

    def add(self, path: Path) -> None:
        """A file that was written and will not change."""
        with self._lock:
            self._waiting.append(path)

    def sync(self) -> None:
        """Do it now."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
        # A disk that fails is told by the next write; here it would tell nobody.
        with contextlib.suppress(OSError):
            for path in waiting:
                fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
                try:
                    os.fsync(fd)
                finally:
                    os.close(fd)
            os.fsync(self._fd)

    def close(self) -> None:
        """Do it for the last time."""
        self._ended.set()
        self._thread.join()
        self.sync()

    def _run(self) -> None:
        while not self._ended.wait(_EVERY_S):
            self.sync()
