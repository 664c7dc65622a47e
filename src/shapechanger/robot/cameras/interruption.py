"""Lets one thread end the waiting of another one for a file descriptor."""

from __future__ import annotations

import os
import select

from shapechanger.errors import RobotError

__all__ = ["Interruption"]


class Interruption:
    """Waits for a descriptor until it is ready, or `set` is called in any thread."""

    def __init__(self) -> None:
        self._read, self._write = os.pipe()
        self._is_set = False

    def wait(self, fd: int, at_most_s: float | None = None) -> bool:
        """Wait until a descriptor can be read.

        Returns:
            Whether it can; False after `at_most_s`.

        Raises:
            RobotError: If `set` was or is called.
        """
        poll = select.poll()
        poll.register(fd, select.POLLIN)
        poll.register(self._read, select.POLLIN)
        ready = poll.poll(None if at_most_s is None else at_most_s * 1e3)
        if self._is_set:
            raise RobotError("The camera is closed.")
        return bool(ready)

    def set(self) -> None:
        """End all waiting, now and later."""
        if not self._is_set:
            self._is_set = True
            os.write(self._write, b"\0")

    def __del__(self) -> None:
        # Not in `set`: another thread may still wait on them.
        os.close(self._read)
        os.close(self._write)
