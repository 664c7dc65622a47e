"""Process priorities, where the system permits them."""

from __future__ import annotations

import contextlib
import gc
import os
import resource

GUARD = 5
"""Real-time priority of the guard."""

SUPERVISOR = 10
"""Real-time priority of the supervisor, above the guard's, so that it can end a busy loop."""

_NICENESS = -10
# Longest uninterrupted run of a real-time process, µs; the kernel then ends it (SIGXCPU) and the
# supervisor restarts it. A round of the guard takes a few thousand.
_MOST_RUN_US = 500_000


def run_early() -> None:
    """Raise this process above normal priority."""
    # Without the permission, a busy neighbour can delay the process a little; the systemd unit
    # grants it.
    with contextlib.suppress(PermissionError):
        os.nice(_NICENESS)


def run_normally(pid: int) -> None:
    """Lower a child process, which inherits this process's priority, to normal priority.

    Call this right after its start: threads that it already has keep their priority.
    """
    with contextlib.suppress(ProcessLookupError):  # It has ended.
        if os.getpriority(os.PRIO_PROCESS, pid) < 0:
            os.setpriority(os.PRIO_PROCESS, pid, 0)


def run_promptly(priority: int) -> None:
    """Switch this process to real-time scheduling and freeze its objects out of garbage collection.

    On a machine with fourteen busy processes, stops were up to 50 ms late when the guard merely had
    a better nice value. Child processes are not real-time.
    """
    run_early()
    # Missing outside Linux, and not permitted to every user; both are fine.
    with contextlib.suppress(AttributeError, PermissionError):
        resource.setrlimit(resource.RLIMIT_RTTIME, (_MOST_RUN_US, _MOST_RUN_US))
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    gc.collect()
    gc.freeze()
