"""A supervisor, guard and stand-in daemon in separate processes, on recorded pins."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.guard import start
from shapechanger.robot.guard.running import ServePlan, plan_fd
from tests.robot.guard.plans import quick_car
from tests.robot.guard.recording import Record
from tests.robot.twin import robots

_START = Path(__file__).with_name("start_recorded.py")
_PINS = {"GPIO17", "GPIO4", "GPIO22", "GPIO27"}

until = partial(robots.until, seconds=20.0)


class Robot:
    """The processes and their record."""

    def __init__(self, process: "subprocess.Popen[bytes]", record: Record) -> None:
        self.process = process
        self.record = record

    def pids(self, opened: str) -> list[int]:
        """Return the pids of the guards ("hardware") or daemons, without the supervisor."""
        lines = self.record.lines()
        pids = [line["pid"] for line in lines if line.get("opened") == opened]
        return [pid for pid in pids if pid != self.process.pid]

    def drive(self) -> None:
        until(lambda: any(line["duty"] > 0.0 for line in self.record.pins()))

    def kill(self, opened: str, number: signal.Signals) -> int:
        """Signal the first guard ("hardware") or daemon; return the time just before, ns."""
        pid, before_ns = self.pids(opened)[0], time.monotonic_ns()
        os.kill(pid, number)
        return before_ns

    def commands(self) -> list[int]:
        return [line["t"] for line in self.record.lines() if "command" in line]

    def rested_ns(self, after_ns: int, pid: int | None = None) -> int:
        """Wait until each pin rests after `after_ns`; return the time at which the last one did.

        With `pid`, only changes that this process made count.
        """
        found: dict[str, int] = {}

        def look() -> bool:
            found.clear()
            for line in self.record.pins():
                if line["t"] < after_ns or (pid is not None and line["pid"] != pid):
                    continue
                if line["duty"] > 0.0:
                    found.pop(line["pin"], None)
                else:
                    found.setdefault(line["pin"], line["t"])
            return found.keys() >= _PINS

        until(look)
        return max(found.values())


@contextlib.contextmanager
def running(folder: Path, plan: GuardPlan | None = None, **daemon: object) -> Iterator[Robot]:
    """Start a robot that drives, and stop it on exit."""
    record = Record(folder / "record")
    record.write(opened="test")
    fd = plan_fd(
        ServePlan(
            guard=plan or replace(quick_car(), sensors=()),
            daemon={"record": str(record.path), **daemon},
            hardware=("tests.robot.guard.recording:connect", str(record.path)),
        )
    )
    program = [sys.executable, "-I", str(_START), str(start.__file__)]
    command = [*program, "supervise", "--plan-fd", str(fd)]
    with open(folder / "log", "wb") as log:
        process = subprocess.Popen(command, pass_fds=[fd], stderr=log)
    os.close(fd)
    robot = Robot(process, record)
    try:
        yield robot
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        # Guard and daemon exit without their supervisor, unless a SIGSTOP still holds them.
        for pid in robot.pids("hardware") + robot.pids("daemon"):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
