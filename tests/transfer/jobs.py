"""Jobs for the tests of executors, in a module that a spawned process can import."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

from shapechanger.errors import OutputError, UnknownName
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


def fill_the_disk(report: ReportSteps) -> None:
    """Raise the error of a file that cannot be written."""
    raise OutputError("Cannot write run.json: No space left on device.")


def vanish(mark: str, report: ReportSteps) -> None:
    """Append a line, and end by SIGKILL."""
    _append(mark)
    os.kill(os.getpid(), signal.SIGKILL)


def vanish_once(mark: str, report: ReportSteps) -> None:
    """Append a line, and end by SIGKILL at the first attempt."""
    again = Path(mark).exists()
    _append(mark)
    if not again:
        os.kill(os.getpid(), signal.SIGKILL)


def _append(mark: str) -> None:
    """Append a line for an attempt."""
    with Path(mark).open("a") as log:
        log.write("attempt\n")


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
    _append(mark)
    never = threading.Event()
    while not Path(go).exists():
        report(time.monotonic_ns())
        never.wait(0.05)
