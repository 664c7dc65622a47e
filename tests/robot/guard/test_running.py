"""The plan, commands, log and priority of the processes."""

import fcntl
import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from unittest.mock import Mock

import pytest

from shapechanger.contract.plan import ActionPlan
from shapechanger.robot.guard import start
from shapechanger.robot.guard.running import (
    ServePlan,
    _Lines,
    command_of,
    descriptors,
    plan_fd,
    read_plan_fd,
    run_normally,
)
from tests.robot.guard.plans import car

pytestmark = pytest.mark.realtime

_PLAN = ServePlan(
    replace(car(), actions=(ActionPlan("throttle"),)),
    {"port": 5000, "nested": {"a": [1, 2]}},
    ("module:function", "argument"),
)


def test_several_processes_can_read_the_plan_and_none_can_change_it() -> None:
    assert (_PLAN.guard_silence_ms, _PLAN.daemon_silence_ms) == (250, 2_000)
    patient = replace(_PLAN, patience_ms=5_000)
    assert (patient.guard_silence_ms, patient.daemon_silence_ms) == (5_000, 5_000)
    fd = plan_fd(_PLAN)
    with os.fdopen(fd):
        assert os.get_inheritable(fd)
        assert read_plan_fd(fd) == _PLAN
        script = f"import os; os.write(1, os.pread({fd}, 1 << 20, 0))"
        data = subprocess.check_output([sys.executable, "-c", script], pass_fds=[fd])
        assert json.loads(data)["daemon"] == _PLAN.daemon
        for change in (lambda: os.pwrite(fd, b"x", 0), lambda: os.ftruncate(fd, 0)):
            with pytest.raises(PermissionError):
                change()
        assert read_plan_fd(fd) == _PLAN


@pytest.mark.parametrize("arguments", [["--a", "1"], ["--a", "1", "--c", "2"], ["--a"]])
def test_wrong_arguments_are_refused(arguments: list[str]) -> None:
    with pytest.raises(ValueError, match=r"This takes --a N --b N|argument 2 is"):
        descriptors(arguments, ("--a", "--b"))


def test_processes_ignore_the_working_folder() -> None:
    assert command_of("guard", _PLAN) == [sys.executable, "-I", start.__file__, "guard"]
    assert command_of("daemon", _PLAN)[1:] == ["-P", "-m", "shapechanger.robot.daemon.process"]


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """A pipe that holds one page."""
    read, write = os.pipe()
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
    yield read, write
    os.close(write)
    os.close(read)


def _emit(lines: logging.Handler, text: str, *args: object) -> None:
    lines.handle(logging.LogRecord("robot", logging.INFO, "/x/rules.py", 7, text, args, None))


class _Unprintable:
    """An argument that cannot be converted to a string."""

    def __str__(self) -> str:
        raise RuntimeError


def test_lines_are_dropped_cut_or_replaced_and_never_wait(pipe: tuple[int, int]) -> None:
    """The next line has the number of lost lines; the descriptor's flags do not change."""
    read, write = pipe
    flags = fcntl.fcntl(write, fcntl.F_GETFL)
    lines = _Lines(write)
    for _ in range(100):
        _emit(lines, "x" * 100)
    written = os.read(read, 1 << 16).count(b"\n")
    assert 0 < written < 100
    _emit(lines, "Again.")
    assert f"Again. ({100 - written} lines before it were lost.)\n".encode() == os.read(read, 4096)
    assert fcntl.fcntl(write, fcntl.F_GETFL) == flags
    _emit(lines, "\ud800" * 10_000)
    data = os.read(read, 1 << 16)
    assert (len(data), data[:6], data[-1:]) == (4096, b"\\ud800", b"\n")
    for text, error in (("%s", "RuntimeError"), ("%s %s", "TypeError")):
        _emit(lines, text, _Unprintable() if error == "RuntimeError" else "one")
        assert os.read(read, 4096) == f"A line of rules.py:7 fails: {error}.\n".encode()


@pytest.mark.parametrize("kind", ["no reader", "closed", "read-only", "full disk"])
def test_a_log_that_cannot_be_written_raises_nothing(kind: str) -> None:
    read, write = os.pipe()
    os.close(read)
    if kind != "no reader":
        os.close(write)
        write = os.open("/dev/full", os.O_RDONLY if kind == "read-only" else os.O_WRONLY)
    lines = _Lines(write)
    if kind == "closed":
        os.close(write)
    for text in ("Hello.", "\ud800", "\0", "a\nb", "x" * 100_000):
        _emit(lines, text)
    assert lines._lost == 5
    if kind != "closed":
        os.close(write)


def test_a_child_runs_normally_unless_it_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
    run_normally(child.pid)
    set_priority = Mock()
    monkeypatch.setattr(os, "setpriority", set_priority)
    for niceness in (-10, 0, 10):
        monkeypatch.setattr(os, "getpriority", lambda *_, niceness=niceness: niceness)
        run_normally(1)
    set_priority.assert_called_once_with(os.PRIO_PROCESS, 1, 0)
