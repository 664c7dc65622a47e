"""The plan, commands, log and priority of processes, and the modules that the guard imports."""

import fcntl
import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace

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
    supervisor_command,
)
from tests.robot.guard.plans import car

pytestmark = pytest.mark.realtime

_PLAN = ServePlan(
    replace(car(), actions=(ActionPlan("throttle"),)),
    {"port": 5000, "nested": {"a": [1, 2]}},
    ("module:function", "argument"),
)


def test_processes_may_be_silent_for_their_limits() -> None:
    assert (_PLAN.guard_silence_ms, _PLAN.daemon_silence_ms) == (250, 2_000)
    patient = replace(_PLAN, patience_ms=5_000)
    assert (patient.guard_silence_ms, patient.daemon_silence_ms) == (5_000, 5_000)


def test_several_processes_can_read_the_plan_and_none_can_change_it() -> None:
    fd = plan_fd(_PLAN)
    try:
        assert os.get_inheritable(fd)
        assert read_plan_fd(fd) == _PLAN
        script = f"import os; os.write(1, os.pread({fd}, 1 << 20, 0))"
        data = subprocess.check_output([sys.executable, "-c", script], pass_fds=[fd])
        assert json.loads(data)["daemon"] == _PLAN.daemon
        for change in (lambda: os.pwrite(fd, b"x", 0), lambda: os.ftruncate(fd, 0)):
            with pytest.raises(PermissionError):
                change()
        assert read_plan_fd(fd) == _PLAN
    finally:
        os.close(fd)


@pytest.mark.parametrize("arguments", [["--a", "1"], ["--a", "1", "--c", "2"], ["--a"]])
def test_wrong_arguments_are_refused(arguments: list[str]) -> None:
    with pytest.raises(ValueError, match=r"This takes --a N --b N|argument 2 is"):
        descriptors(arguments, ("--a", "--b"))


def test_processes_ignore_the_working_folder() -> None:
    assert command_of("guard", _PLAN) == [sys.executable, "-I", start.__file__, "guard"]
    assert supervisor_command(_PLAN, 7)[1:] == ["-I", start.__file__, "supervise", "--plan-fd", "7"]
    assert command_of("daemon", _PLAN)[1:] == ["-P", "-m", "shapechanger.robot.daemon.process"]


_LISTS_MODULES = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("start", sys.argv[1])
start = importlib.util.module_from_spec(spec)
spec.loader.exec_module(start)
start._put_package_in_place()
import importlib
for module in ("guard.process", "guard.supervisor", "twin.hardware"):
    importlib.import_module(f"shapechanger.robot.{module}")
print(*(name for name in sys.modules if ".drivers." in name or name == "importlib.metadata"))
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
for chips in (OUTPUTS, PULSES, SENSORS):
    list(chips.values())
print(*sys.modules)
"""


def test_guard_and_supervisor_import_only_their_drivers() -> None:
    command = [sys.executable, "-I", "-c", _LISTS_MODULES, start.__file__]
    before = "import sys; print(*sys.modules)"
    bare = subprocess.check_output([sys.executable, "-I", "-c", before], text=True).split()
    first, all_loaded = subprocess.check_output(command, text=True).split("\n", 1)
    # Without a chip these suffice: each other module costs the guard memory.
    assert {name.rpartition(".")[2] for name in first.split()} == {"chip", "pins", "simulation"}
    loaded = all_loaded.split()
    # gpiozero and msgspec prefer backports where another package has brought them.
    backport = {"importlib_metadata", "lazy_importer", "typing_extensions", "zipp"}
    theirs = {"gpiozero", "colorzero", "lgpio", "_lgpio", "smbus2", "msgspec", "start"} | backport
    for module in set(loaded) - set(bare):
        top = module.partition(".")[0]
        if top == "shapechanger":
            ours = module.split(".")[1:2]
            assert ours in ([], ["errors"], ["robot"], ["contract"]), module
            inner = ["guard", "drivers", "hardware", "plan", "limits", "duty", "twin"]
            assert module.split(".")[2:3] in ([], *([one] for one in inner)), module
        else:
            assert top in theirs or top in sys.stdlib_module_names, module


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """A pipe that holds one page."""
    read, write = os.pipe()
    fcntl.fcntl(write, fcntl.F_SETPIPE_SZ, 4096)
    yield read, write
    os.close(write)
    os.close(read)


def _emit(lines: logging.Handler, text: str) -> None:
    lines.handle(logging.LogRecord("robot", logging.INFO, "", 0, text, None, None))


def test_a_full_pipe_drops_lines(
    pipe: tuple[int, int],
) -> None:
    read, write = pipe
    flags = fcntl.fcntl(write, fcntl.F_GETFL)
    lines = _Lines(write)
    for _ in range(100):
        _emit(lines, "x" * 100)
    seen = os.read(read, 1 << 16)
    written = seen.count(b"\n")
    assert 0 < written < 100
    _emit(lines, "Again.")
    assert (
        os.read(read, 1 << 16) == f"Again. ({100 - written} lines before it were lost.)\n".encode()
    )
    assert fcntl.fcntl(write, fcntl.F_GETFL) == flags


def test_a_line_is_cut_to_the_size_of_a_pipe(pipe: tuple[int, int]) -> None:
    read, write = pipe
    _emit(_Lines(write), "\ud800" * 10_000)
    data = os.read(read, 1 << 16)
    assert len(data) == 4096
    assert data.startswith(b"\\ud800")
    assert data.endswith(b"\n")


class _Unprintable:
    """An argument whose text cannot be made."""

    def __init__(self, error: Exception) -> None:
        self._error = error

    def __str__(self) -> str:
        raise self._error


@pytest.mark.parametrize(
    ("text", "args", "error"),
    [
        ("%s", (_Unprintable(RuntimeError()),), "RuntimeError"),
        ("%s %s", ("one",), "TypeError"),
    ],
)
def test_a_line_that_cannot_be_formatted_is_replaced(
    pipe: tuple[int, int], text: str, args: tuple[object, ...], error: str
) -> None:
    read, write = pipe
    record = logging.LogRecord("robot", logging.INFO, "/x/rules.py", 7, text, args, None)
    _Lines(write).handle(record)
    assert os.read(read, 1 << 16) == f"A line of rules.py:7 fails: {error}.\n".encode()


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


@pytest.mark.parametrize(("before", "after"), [(-10, [0]), (0, []), (10, [])])
def test_a_child_runs_normally(
    before: int, after: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    changes: list[int] = []
    monkeypatch.setattr(os, "getpriority", lambda *_: before)
    monkeypatch.setattr(os, "setpriority", lambda _kind, _pid, value: changes.append(value))
    run_normally(1)
    assert changes == after


def test_a_child_that_has_ended() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
    run_normally(child.pid)
