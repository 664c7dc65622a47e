"""Keeps a rate in real time, and ends a wait when the camera is closed."""

from __future__ import annotations

import threading
import time

from shapechanger.errors import RobotError

__all__ = ["Pace"]


class Pace:
    """So many pictures a second.

    Args:
        fps: How many.
    """

    def __init__(self, fps: float) -> None:
        self._period_ns = round(1e9 / fps)
        self._next_ns = time.monotonic_ns()
        self._closed = threading.Event()

    def wait(self) -> int:
        """Wait for the time of the next picture, and return it: nanoseconds, monotonic.

        One that is late is taken at once, and the rest keeps the rate from there.

        Raises:
            RobotError: If the camera is closed.
        """
        left_ns = self._next_ns - time.monotonic_ns()
        if self._closed.wait(max(0.0, left_ns / 1e9)):
            raise RobotError("The camera is closed.")
        now_ns = time.monotonic_ns()
        self._next_ns = max(self._next_ns, now_ns - self._period_ns) + self._period_ns
        return now_ns

    def close(self) -> None:
        """End all waiting, now and later."""
        self._closed.set()
