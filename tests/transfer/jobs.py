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
    report(1)
    Path(path).write_text(str(time.monotonic_ns()))


def refuse(report: ReportSteps) -> None:
    raise UnknownName("thing", "this", ["that"])


def crash(report: ReportSteps) -> None:
    raise ZeroDivisionError("a bug")


def fill_the_disk(report: ReportSteps) -> None:
    raise OutputError("Cannot write run.json: No space left on device.")


def vanish(mark: str, report: ReportSteps) -> None:
    _append(mark)
    os.kill(os.getpid(), signal.SIGKILL)


def vanish_once(mark: str, report: ReportSteps) -> None:
    if Path(mark).exists():
        _append(mark)
    else:
        vanish(mark, report)


def _append(mark: str) -> None:
    with Path(mark).open("a") as log:
        log.write("attempt\n")


def wait_for_ever(pid_file: str, report: ReportSteps) -> None:
    Path(pid_file).write_text(str(os.getpid()))
    while True:
        signal.pause()


def run_for_ever(pid_file: str) -> None:
    Processes(1).run([Job("endless", wait_for_ever, (pid_file,))], lambda *_: None)


def end_when_there_is_one(mark: str, go: str, report: ReportSteps) -> None:
    _append(mark)
    never = threading.Event()
    while not Path(go).exists():
        report(time.monotonic_ns())
        never.wait(0.05)
