"""How guard and supervisor say what happens: one line a fact, on standard error.

Nobody may read what they say: a terminal that was stopped, a pipe that is full. Then lines are
lost, and the robot goes on.
"""

from __future__ import annotations

import logging
import os
import select
import sys
from typing import Final

__all__ = ["log_to_stderr", "shortened"]

_STDERR: Final = 2


class _Lines(logging.Handler):
    """Writes a line only where there is room for it at once, and counts those that are lost.

    The descriptor is shared with other processes, so it stays as it is: O_NONBLOCK would be theirs
    too. A line has no more bytes than a pipe that can be written takes without waiting.
    """

    def __init__(self, fd: int) -> None:
        super().__init__()
        self._fd = fd
        self._poll = select.poll()
        self._poll.register(fd, select.POLLOUT)
        self._lost = 0

    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)
        if self._lost:
            text = f"{text} ({self._lost} lines before it were lost.)"
        if self._write(text):
            self._lost = 0
        else:
            self._lost += 1

    def _write(self, text: str) -> bool:
        line = text.encode(errors="backslashreplace")[: select.PIPE_BUF - 1] + b"\n"
        try:
            ready = self._poll.poll(0)
            if not ready or not ready[0][1] & select.POLLOUT:
                return False
            os.write(self._fd, line)
        except OSError:  # A full disk, or nobody at the other end any more.
            return False
        return True


def log_to_stderr(program: str) -> logging.Logger:
    """The log of a program, whose lines begin with its name."""
    logging.raiseExceptions = False  # What cannot be formatted must not stop the guard.
    # Without standard error its number may be that of anything.
    handler = logging.NullHandler() if sys.__stderr__ is None else _Lines(_STDERR)
    handler.setFormatter(logging.Formatter(f"{program}: %(message)s"))
    log = logging.getLogger(f"shapechanger.robot.{program}")
    log.handlers = [handler]
    log.setLevel(logging.INFO)
    log.propagate = False
    return log


def shortened(text: str, most_bytes: int = 200) -> str:
    """The beginning of a text, as far as it fits into so many bytes of UTF-8."""
    data = text.encode(errors="replace")
    if len(data) <= most_bytes:
        return data.decode()
    return f"{data[:most_bytes].decode(errors='ignore')}..."
