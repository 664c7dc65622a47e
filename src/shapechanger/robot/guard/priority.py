"""Lets a process run before others, where that is allowed."""

from __future__ import annotations

import contextlib
import gc
import os

__all__ = ["run_promptly"]

_NICENESS = -10


def run_promptly() -> None:
    """Ask for more of the processor, and keep what is loaded by now out of garbage collection."""
    # Without the right to it the guard works as well, only behind a busy neighbour a little later;
    # the systemd unit gives the right. Real-time scheduling would let a bug starve the supervisor.
    with contextlib.suppress(PermissionError):
        os.nice(_NICENESS)
    gc.collect()
    gc.freeze()
