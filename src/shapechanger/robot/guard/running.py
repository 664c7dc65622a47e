"""Plan, log and priority of the processes of a robot.

The command line checks a profile once, turns it into a `ServePlan` and starts the supervisor with
it. Guard and supervisor log one line per event on standard error. If its reader stops, such as a
terminal, lines are dropped once it is full, and the robot continues.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import json
import logging
import os
import resource
import select
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

import msgspec

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.guard import start
from shapechanger.robot.hardware import REAL

_DAEMON_SILENCE_MS: Final = 2000


@dataclass(frozen=True, slots=True)
class ServePlan:
    """Everything that supervisor, guard and daemon need.

    Attributes:
        guard: Plan of the guard.
        daemon: Fields of the `DaemonPlan`, which the guard does not import.
        hardware: Factory of the hardware and its argument; see
            `shapechanger.robot.hardware.connect`.
        python: The interpreter that runs the processes.
        patience_ms: Lower bound on the silence after which guard and daemon are killed, ms; their
            own limits apply if they are longer. 0 on a robot, and on a twin in real time, whose
            guard sends heartbeats while its board is delayed. Above 0 on other twins: their clock
            is paused while the machine is busy or renders, and a guard that waits for it is alive.
    """

    guard: GuardPlan
    daemon: dict[str, Any]
    hardware: tuple[str, str] = (REAL, "")
    python: str = sys.executable
    patience_ms: int = 0

    @property
    def guard_silence_ms(self) -> int:
        """Silence after which a guard that has sent a heartbeat is killed, ms."""
        return max(self.patience_ms, self.guard.limits.deadline_ms)

    @property
    def daemon_silence_ms(self) -> int:
        """Silence after which a daemon that has sent a heartbeat is killed, ms."""
        return max(self.patience_ms, _DAEMON_SILENCE_MS)


def plan_fd(plan: ServePlan) -> int:
    """Return an open file with the plan for child processes to inherit; close it afterwards.

    The file is anonymous, so that no file is left behind; sealed, so that no process can change it;
    and in memory, so that a full disk does not keep a robot from starting.
    """
    # Without MFD_CLOEXEC, so that `exec` keeps it open.
    fd = os.memfd_create("serve-plan", os.MFD_ALLOW_SEALING)
    # msgspec encodes neither infinities nor pins, which are a subclass of int.
    left = memoryview(json.dumps(asdict(plan)).encode())
    while left:
        left = left[os.write(fd, left) :]
    # The guard reads its limits from this file, so a faulty daemon must not change it.
    seals = fcntl.F_SEAL_WRITE | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_SEAL
    fcntl.fcntl(fd, fcntl.F_ADD_SEALS, seals)
    return fd


def command_of(program: Literal["supervise", "guard", "daemon"], plan: ServePlan) -> list[str]:
    """Return the command line of a process, without its descriptors."""
    if program == "daemon":
        # -P: a file in the working directory must not shadow a module.
        return [plan.python, "-P", "-m", "shapechanger.robot.daemon.process"]
    return [plan.python, "-I", str(Path(start.__file__).resolve()), program]


def read_plan_fd(fd: int) -> ServePlan:
    """Read the plan without moving the file position, which several processes share."""
    data = b""
    while part := os.pread(fd, 1 << 16, len(data)):
        data += part
    return msgspec.convert(json.loads(data), ServePlan)


AFTER_FAILURE: Final = "--after-failure"
"""Argument of a guard that is started after a failure."""


def descriptors(arguments: Sequence[str], names: Sequence[str]) -> dict[str, int]:
    """Parse the file descriptors of a command line such as `--plan-fd 3 --heartbeat-fd 4`."""
    pairs = dict(zip(arguments[::2], arguments[1::2], strict=True))
    if sorted(pairs) != sorted(names):
        raise ValueError(f"This takes {' N '.join(names)} N, not {' '.join(arguments)}.")
    return {name: int(value) for name, value in pairs.items()}


_STDERR: Final = 2


class _Lines(logging.Handler):
    """Write lines without blocking, and count those that are dropped; never raise.

    The descriptor is shared with other processes, so it must not become O_NONBLOCK. A line is cut
    to the length that a writable pipe accepts without blocking.
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
        except Exception as error:  # Formatting an argument may raise anything.
            text = f"A line of {record.filename}:{record.lineno} fails: {type(error).__name__}."
        if self._lost:
            text = f"{text} ({self._lost} lines before it were lost.)"
        self._lost = 0 if self._write(text) else self._lost + 1

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


def log_to_stderr(program: str, name: str | None = None) -> logging.Logger:
    """Return the logger `name`, or the program's; each line begins with the program's name."""
    logging.raiseExceptions = False  # An unprintable message must not stop the guard.
    # If standard error is closed, descriptor 2 may belong to any file.
    handler = logging.NullHandler() if sys.__stderr__ is None else _Lines(_STDERR)
    handler.setFormatter(logging.Formatter(f"{program}: %(message)s"))
    log = logging.getLogger(f"shapechanger.robot.{program}" if name is None else name)
    log.handlers = [handler]
    log.setLevel(logging.INFO)
    log.propagate = False
    return log


def shortened(text: str, most_bytes: int = 200) -> str:
    """Return a text, cut after `most_bytes` and followed by "..." if it is longer."""
    data = text.encode(errors="replace")
    if len(data) <= most_bytes:
        return data.decode()
    return f"{data[:most_bytes].decode(errors='ignore')}..."


GUARD: Final = 5
"""Real-time priority of the guard."""

SUPERVISOR: Final = 10
"""Real-time priority of the supervisor, above the guard's, so that it can kill a busy guard."""

_NICENESS: Final = -10
# Longest run of a real-time process without a blocking call, µs; the kernel then kills it
# (SIGKILL), and the supervisor replaces a guard. A round of the guard takes a few thousand µs.
_MOST_RUN_US: Final = 500_000


def run_early() -> None:
    """Raise this process above normal priority, if it has the permission."""
    # The systemd unit grants it. Without it, other busy processes delay this one.
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
    """Switch to real-time scheduling if permitted; exempt present objects from garbage collection.

    With a better nice value alone, stops are late on a busy machine. Child processes are not
    real-time.
    """
    run_early()
    # Only Linux has real-time scheduling, and not for every user; the robot also runs without it.
    with contextlib.suppress(AttributeError, PermissionError):
        resource.setrlimit(resource.RLIMIT_RTTIME, (_MOST_RUN_US, _MOST_RUN_US))
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    gc.collect()
    gc.freeze()
