"""Jobs for the tests of executors, in a module that a spawned process can import."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

from shapechanger.errors import UnknownName
from shapechanger.transfer.executor import Job, Processes, ReportSteps


def leave_a_mark(path: str, report: ReportSteps) -> None:
    """Write the time to a file."""
    report(1)
    Path(path).write_text(str(time.monotonic_ns()))


def refuse(report: ReportSteps) -> None:
    """Raise a ShapechangerError."""
    raise UnknownName("thing", "this", ["that"])


def crash(report: ReportSteps) -> None:
    """Raise an error that is not a ShapechangerError."""
    raise ZeroDivisionError("a bug")


def vanish(report: ReportSteps) -> None:
    """End by SIGKILL."""
    os.kill(os.getpid(), signal.SIGKILL)


def wait_for_ever(pid_file: str, report: ReportSteps) -> None:
    """Write the process id to a file and wait."""
    Path(pid_file).write_text(str(os.getpid()))
    while True:
        signal.pause()


def run_for_ever(pid_file: str) -> None:
    """Run a job that never ends."""
    Processes(1).run([Job("endless", wait_for_ever, (pid_file,))], lambda *_: None)


def end_when_there_is_one(mark: str, go: str, report: ReportSteps) -> None:
    """Append a line for each attempt, and end once `go` exists."""
    with Path(mark).open("a") as log:
        log.write("attempt\n")
    never = threading.Event()
    while not Path(go).exists():
        report(time.monotonic_ns())
        never.wait(0.05)
