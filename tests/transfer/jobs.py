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
    """Write the time at which the job ended."""
    report(1)
    Path(path).write_text(str(time.monotonic_ns()))


def refuse(report: ReportSteps) -> None:
    """Fail as a user's mistake does."""
    raise UnknownName("thing", "this", ["that"])


def crash(report: ReportSteps) -> None:
    """Fail as a bug does."""
    raise ZeroDivisionError("a bug")


def vanish(report: ReportSteps) -> None:
    """End without a word, as under the kernel's axe."""
    os.kill(os.getpid(), signal.SIGKILL)


def wait_for_ever(pid_file: str, report: ReportSteps) -> None:
    """Say who runs it, and go on until somebody ends it."""
    Path(pid_file).write_text(str(os.getpid()))
    while True:
        signal.pause()


def run_for_ever(pid_file: str) -> None:
    """A parent whose only job never ends."""
    Processes(1).run([Job("endless", wait_for_ever, (pid_file,))], lambda *_: None)


def end_when_there_is_one(mark: str, go: str, report: ReportSteps) -> None:
    """Note each attempt, and end once a file is there."""
    with Path(mark).open("a") as log:
        log.write("attempt\n")
    never = threading.Event()
    while not Path(go).exists():
        report(time.monotonic_ns())
        never.wait(0.05)
