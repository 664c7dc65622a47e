"""A thread that reads disks, so that the connections do not wait for them."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Final

__all__ = ["Worker"]

_JOIN_S: Final = 2.0


class Worker:
    """Does one thing after the other in a thread that begins with the first."""

    def __init__(self) -> None:
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def do(self, work: Callable[[], None]) -> None:
        """Do something once everything before is done; whoever asks keeps the number bounded."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="library", daemon=True)
            self._thread.start()
        self._work.put(work)

    def close(self) -> None:
        """End the thread, but do not wait for a disk that is stuck."""
        if self._thread is not None:
            self._work.put(None)
            self._thread.join(_JOIN_S)

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            work()
