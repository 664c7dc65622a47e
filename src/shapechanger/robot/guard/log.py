"""How guard and supervisor say what happens: one line a fact, on standard error."""

from __future__ import annotations

import logging
import sys

__all__ = ["log_to_stderr"]


def log_to_stderr(program: str) -> logging.Logger:
    """The log of a program, whose lines begin with its name."""
    logging.raiseExceptions = False  # A full disk behind the log must not stop the guard.
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter(f"{program}: %(message)s"))
    log = logging.getLogger(f"shapechanger.robot.{program}")
    log.handlers = [handler]
    log.setLevel(logging.INFO)
    log.propagate = False
    return log
