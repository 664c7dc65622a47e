"""Lets a process run before others, where that is allowed."""

from __future__ import annotations

import contextlib
import gc
import os
import resource

__all__ = ["GUARD", "SUPERVISOR", "run_early", "run_promptly"]

GUARD = 5
"""Real-time priority of the guard."""

SUPERVISOR = 10
"""Real-time priority of the supervisor: it ends a guard that does nothing but run."""

_NICENESS = -10
# µs that a real-time process may run without ever waiting; then the kernel ends it (SIGXCPU), and
# the supervisor starts another. A round of the guard takes a few thousand.
_MOST_RUN_US = 500_000


def run_early() -> None:
    """Ask for more of the processor."""
    # Without the right to it everything works as well, only behind a busy neighbour a little later;
    # the systemd unit gives the right.
    with contextlib.suppress(PermissionError):
        os.nice(_NICENESS)


def run_promptly(priority: int) -> None:
    """Run before everything that is not real-time, and keep what is loaded out of collection.

    A machine that is busy with fourteen other things delayed stops by up to 50 ms where the guard
    was merely a nice process. What it starts is not real-time.

    Args:
        priority: `GUARD` or `SUPERVISOR`.
    """
    run_early()
    # `os` has neither where there is no Linux; who has no right to it goes on as it is.
    with contextlib.suppress(AttributeError, PermissionError):
        resource.setrlimit(resource.RLIMIT_RTTIME, (_MOST_RUN_US, _MOST_RUN_US))
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    gc.collect()
    gc.freeze()
