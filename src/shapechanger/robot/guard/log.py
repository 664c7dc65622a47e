"""Log of the guard and the supervisor: one line per event, on standard error.

The reader may be stalled, such as a stopped terminal or a full pipe. Lines are then dropped and the
robot continues.
"""

from __future__ import annotations

import logging
import os
import select
import sys
from typing import Final

_STDERR: Final = 2


class _Lines(logging.Handler):
    """Write lines without blocking, and count those that are dropped; never raise.

    The descriptor is shared with other processes, so it must not become O_NONBLOCK. A line is no
    longer than a writable pipe accepts without blocking.
    """

    def __init__(self, fd: int) -> None:
        super().__init__()
        self._fd = fd
        self._poll = select.poll()
        self._poll.register(fd, select.POLLOUT)
        self._lost = 0

    def emit(self, record: logging.LogRecord) -> None:
        try:
            text = self.format(record)
        except Exception as error:  # An argument's own, when it is printed.
            text = f"A line of {record.filename}:{record.lineno} fails: {type(error).__name__}."
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
        except OSError:  # A full disk, or a closed pipe.
            return False
        return True


def log_to_stderr(program: str) -> logging.Logger:
    """Return the log function of a program, which prefixes each line with the program's name."""
    logging.raiseExceptions = False  # An unprintable message must not stop the guard.
    # Without standard error, its number may belong to any file.
    handler = logging.NullHandler() if sys.__stderr__ is None else _Lines(_STDERR)
    handler.setFormatter(logging.Formatter(f"{program}: %(message)s"))
    log = logging.getLogger(f"shapechanger.robot.{program}")
    log.handlers = [handler]
    log.setLevel(logging.INFO)
    log.propagate = False
    return log


def shortened(text: str, most_bytes: int = 200) -> str:
    """Return the longest prefix of a text that fits."""
    data = text.encode(errors="replace")
    if len(data) <= most_bytes:
        return data.decode()
    return f"{data[:most_bytes].decode(errors='ignore')}..."
