"""Pins rest when processes are killed, stopped or silent, with real processes and signals.

The time limits are ten times those promised, because the test machine may be busy; `make bench`
measures the real times.
"""

import contextlib
import logging
import os
import re
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.contract.plan import GuardPlan, LimitPlan
from shapechanger.robot.guard import supervisor
from shapechanger.robot.guard.running import ServePlan
from shapechanger.robot.guard.supervisor import Restarts, Supervisor
from shapechanger.robot.hardware import Hardware
from tests.robot.guard.plans import MS, quick_car
from tests.robot.guard.running import running
from tests.robot.guard.waiting import until

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Robots run Linux."),
    pytest.mark.realtime,
]

_MOST_GUARD_KB = 25 * 1024


def _is_gone(pid: int) -> bool:
    try:
        # A zombie process has no memory.
        return "VmRSS" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return True


def _log(folder: Path) -> str:
    return (folder / "log").read_text()


def test_sigterm_stops_the_robot(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        status = Path(f"/proc/{robot.pids('hardware')[0]}/status").read_text()
        resident_kb = int(status.partition("VmRSS:")[2].split()[0])
        assert resident_kb < _MOST_GUARD_KB
        robot.process.terminate()
        assert robot.process.wait(20) == 0
        assert robot.record.is_at_rest()
        assert all(map(_is_gone, robot.pids("hardware") + robot.pids("daemon")))


def test_the_daemon_can_end_the_robot(tmp_path: Path) -> None:
    with running(tmp_path, commands=5, ends=True) as robot:
        assert robot.process.wait(20) == 0
        assert robot.record.is_at_rest()


def test_killed_daemon(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        guard = robot.pids("hardware")[0]
        killed_ns = robot.kill("daemon", signal.SIGKILL)
        assert robot.rested_ns(killed_ns, guard) - killed_ns < 200 * MS
        until(lambda: len(robot.pids("daemon")) == len(robot.pids("hardware")) == 2)
        assert _is_gone(guard)
        assert robot.record.is_at_rest()
        # The restart must not clear a stop.
        text = "guard: Emergency stop: the robot's processes failed and started afresh."
        until(lambda: text in _log(tmp_path))


def test_silent_daemon(tmp_path: Path) -> None:
    with running(tmp_path, commands=20) as robot:
        until(lambda: len(robot.commands()) == 20)
        last_ns = robot.commands()[-1]
        rested_ns = robot.rested_ns(last_ns)
        assert 240 * MS < rested_ns - last_ns < 450 * MS


def test_stopped_daemon(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        stopped_ns = robot.kill("daemon", signal.SIGSTOP)
        assert robot.rested_ns(stopped_ns) - stopped_ns < 450 * MS
        until(lambda: len(robot.pids("daemon")) == 2)
        assert _is_gone(robot.pids("daemon")[0])
        assert "the daemon was silent, and was killed" in _log(tmp_path)


@pytest.mark.parametrize(("number", "most_ms"), [(signal.SIGKILL, 1_000), (signal.SIGSTOP, 3_500)])
def test_killed_or_stopped_guard(tmp_path: Path, number: signal.Signals, most_ms: int) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        guard = robot.pids("hardware")[0]
        gone_ns = robot.kill("hardware", number)
        assert robot.rested_ns(gone_ns, robot.process.pid) - gone_ns < most_ms * MS
        assert _is_gone(guard)
        until(lambda: len(robot.pids("hardware")) == 2)
        assert robot.record.is_at_rest()


def test_killed_supervisor(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        guard = robot.pids("hardware")[0]
        killed_ns = robot.record.lines()[-1]["t"]
        robot.process.kill()
        assert robot.rested_ns(killed_ns, guard) - killed_ns < 1_000 * MS
        until(lambda: all(map(_is_gone, (guard, *robot.pids("daemon")))))
        assert robot.record.is_at_rest()


def test_a_resumed_supervisor_restarts_nothing(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        os.kill(robot.process.pid, signal.SIGSTOP)
        count = len(robot.commands())
        until(lambda: len(robot.commands()) > count + 50)
        os.kill(robot.process.pid, signal.SIGCONT)
        until(lambda: len(robot.commands()) > count + 80)
        assert len(robot.pids("hardware")) == 1


def test_the_supervisor_gives_up_after_too_many_failures(tmp_path: Path) -> None:
    with running(tmp_path, record="/nowhere/record") as robot:
        assert robot.process.wait(60) == 1
        assert robot.record.is_at_rest()
    assert "gives up after too many failures: the daemon has ended." in _log(tmp_path)


def test_a_stuck_output_is_reported_as_unsafe(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        stuck_ns = robot.record.lines()[-1]["t"]
        (tmp_path / "stuck-GPIO22").touch()
        os.kill(robot.pids("daemon")[0], signal.SIGSTOP)  # At the deadline it must rest.
        until(lambda: "Emergency stop" in _log(tmp_path))
        pins = [line for line in robot.record.pins() if line["t"] > stuck_ns]
        assert [line["duty"] for line in pins if line["pin"] == "GPIO17"][-1] == 0.0
        robot.process.terminate()
        assert robot.process.wait(20) == 3
    assert "GPIO22 is stuck" in _log(tmp_path)
    assert "NOT SAFE" in _log(tmp_path)


def test_a_stuck_output_is_retried(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.drive()
        (tmp_path / "stuck-GPIO22").touch()
        robot.kill("hardware", signal.SIGKILL)

        def attempts() -> int:
            lines = robot.record.lines()
            return sum(
                x.get("opened") == "hardware" and x["pid"] == robot.process.pid for x in lines
            )

        until(lambda: attempts() > 8)  # More attempts than allowed restarts.
        assert len(robot.pids("hardware")) == 1
        mended_ns = robot.record.lines()[-1]["t"]
        (tmp_path / "stuck-GPIO22").unlink()
        assert robot.rested_ns(mended_ns, robot.process.pid) - mended_ns < 2_000 * MS
        until(lambda: len(robot.pids("hardware")) == 2)
    assert _log(tmp_path).count("NOT SAFE") == 1


def test_a_stuck_output_at_the_start_ends_the_supervisor(tmp_path: Path) -> None:
    (tmp_path / "stuck-GPIO22").touch()
    with running(tmp_path) as robot:
        assert robot.process.wait(30) == 3
    assert re.search("gives up: .* has ended, and not all outputs are at rest.", _log(tmp_path))


class _Stuck:
    """A guard stuck in the kernel: SIGKILL takes effect only after some polls."""

    name = "guard"
    has_beaten = True

    def __init__(self, looks: int) -> None:
        self.killed = True
        self.looks = looks
        self.code: int | None = None

    def is_gone(self, now_ns: int) -> bool:
        return self.has_ended()

    def has_ended(self) -> bool:
        self.looks -= 1
        if self.looks <= 0:
            self.code = -9
        return self.looks <= 0

    def close(self) -> None:
        """Nothing is open."""

    def __getattr__(self, name: str) -> object:
        raise AssertionError(f"{name} was used although the guard was already killed")


class _Daemon(_Stuck):
    """A daemon that exits when terminated."""

    name = "daemon"

    def terminate(self) -> None:
        self.code = 0

    def end(self, at_most_s: float, reap_s: float) -> None:
        self.code = 0


@contextlib.contextmanager
def _supervisor(end_reason: str, **daemon: object) -> Iterator[Supervisor]:
    """A supervisor without processes."""
    log = logging.getLogger("test")
    one = Supervisor(ServePlan(quick_car(), daemon), -1, log)
    one._end_reason = end_reason
    with one._woken, one._waker:
        yield one


@pytest.mark.parametrize("end_reason", ["", "ended by SIGTERM"])
def test_a_guard_stuck_in_the_kernel_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch, end_reason: str
) -> None:
    attempts: list[int | None] = []
    guard = _Stuck(looks=4)

    def safe(plan: GuardPlan, hardware: Hardware) -> list[str]:
        attempts.append(guard.code)
        return ["Output drive: GPIO22 is busy"] if len(attempts) == 1 else []

    monkeypatch.setattr(supervisor, "make_safe", safe)
    monkeypatch.setattr(supervisor, "_AGAIN_S", 0.0)
    with _supervisor(end_reason) as one:
        one._stop(guard, _Daemon(looks=9))
    assert attempts == [None, None, None, -9]
    assert one._is_safe


def test_a_guard_that_never_exits_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(supervisor, "make_safe", lambda plan, hardware: [])
    monkeypatch.setattr(supervisor, "_AGAIN_S", 0.0)
    monkeypatch.setattr(supervisor, "_UNSAFE_S", 0.01)
    with _supervisor("ended by SIGTERM") as one:
        one._stop(_Stuck(looks=10**9), _Daemon(looks=9))
    assert not one._is_safe


@pytest.mark.parametrize("ready_file", ["ready.json", "folder"])
def test_the_ready_file_goes_with_its_daemon(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
    ready_file: str,
) -> None:
    (tmp_path / "ready.json").write_text("{}")
    (tmp_path / "folder").mkdir()
    monkeypatch.setattr(supervisor, "make_safe", lambda plan, hardware: [])
    with _supervisor("", ready_file=str(tmp_path / ready_file)) as one:
        one._stop(_Stuck(looks=0), _Daemon(looks=9))
    assert one._is_safe
    assert (tmp_path / "ready.json").exists() == (ready_file == "folder")
    assert ("cannot be removed" in caplog.text) == (ready_file == "folder")


def test_an_unknown_driver_ends_the_supervisor(tmp_path: Path) -> None:
    plan = quick_car(LimitPlan())
    plan = replace(plan, outputs=(replace(plan.outputs[0], driver="magic"),), sensors=())
    with running(tmp_path, plan) as robot:
        assert robot.process.wait(20) == 2
    assert "magic" in _log(tmp_path)


def test_restarts_are_limited_per_period() -> None:
    restarts = Restarts(most=2, within_s=60.0)
    second = 10**9
    assert [restarts.may_restart(t * second) for t in (0, 30, 59, 60, 61, 90)] == [
        True,
        True,
        False,
        True,
        False,
        True,
    ]


def test_restarts_back_off() -> None:
    restarts = Restarts()
    pauses = [restarts.pause_s for t in range(5) if restarts.may_restart(t)]
    assert pauses == pytest.approx([0.0, 0.2, 0.6, 1.4, 3.0])
