"""Facts for the log, which never hold up a robot: not by a full disk, nor by a stuck pipe."""

from __future__ import annotations

import logging
import queue
from logging.handlers import QueueHandler, QueueListener
from typing import Final

__all__ = ["start_log"]

_MOST_LINES: Final = 1000


def start_log(program: str) -> QueueListener:
    """Send the log to stderr, from a thread of its own; lines for which there is no room are lost.

    Returns:
        What writes the lines; stop it at the end, so that the last ones are written.
    """
    # A line that cannot be written must not become another line that cannot be written.
    logging.raiseExceptions = False
    lines: queue.Queue[logging.LogRecord] = queue.Queue(_MOST_LINES)
    stderr = logging.StreamHandler()
    stderr.setFormatter(logging.Formatter(f"{program}: %(message)s"))
    root = logging.getLogger()
    root.setLevel(logging.WARNING)
    logging.getLogger("shapechanger").setLevel(logging.INFO)
    root.addHandler(QueueHandler(lines))
    listener = QueueListener(lines, stderr)
    listener.start()
    return listener
