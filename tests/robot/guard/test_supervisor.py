"""Killed, stopped and silent processes: the pins rest, with real processes and real signals.

The times allowed are ten times those that are promised, because the machine that runs the tests
does other things too; `make bench` measures them.
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

from shapechanger.robot.guard import supervisor
from shapechanger.robot.guard.plan import GuardPlan, LimitPlan
from shapechanger.robot.guard.serve_plan import ServePlan
from shapechanger.robot.guard.supervisor import ProcessCommands, Supervisor
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
        # A process that ended and was not waited for has no memory any more.
        return "VmRSS" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return True


def _log(folder: Path) -> str:
    return (folder / "log").read_text()


def test_told_to_end_it_rests_and_ends(tmp_path: Path) -> None:
    """SIGTERM is the orderly way; the guard is as small as promised."""
    with running(tmp_path) as robot:
        robot.drive()
        status = Path(f"/proc/{robot.pids('hardware')[0]}/status").read_text()
        resident_kb = int(status.partition("VmRSS:")[2].split()[0])
        assert resident_kb < _MOST_GUARD_KB
        robot.process.terminate()
        assert robot.process.wait(20) == 0
        assert robot.record.is_at_rest()
        assert all(map(_is_gone, robot.pids("hardware") + robot.pids("daemon")))


def test_the_daemon_may_end_it(tmp_path: Path) -> None:
    """The order "end" ends the guard, and then there is nothing to supervise."""
    with running(tmp_path, commands=5, ends=True) as robot:
        assert robot.process.wait(20) == 0
        assert robot.record.is_at_rest()


def test_killed_daemon(tmp_path: Path) -> None:
    """The guard notices the end of the stream, and both are started afresh, not armed."""
    with running(tmp_path) as robot:
        robot.drive()
        guard = robot.pids("hardware")[0]
        killed_ns = robot.kill("daemon", signal.SIGKILL)
        assert robot.rested_ns(killed_ns, guard) - killed_ns < 200 * MS
        until(lambda: len(robot.pids("daemon")) == len(robot.pids("hardware")) == 2)
        assert _is_gone(guard)
        assert robot.record.is_at_rest()
        # Whatever was stopped before stays stopped.
        words = "guard: Emergency stop: the robot's processes failed and started afresh."
        until(lambda: words in _log(tmp_path))


def test_silent_daemon(tmp_path: Path) -> None:
    """It lives and says nothing more: the newest command acts until its deadline, no longer."""
    with running(tmp_path, commands=20) as robot:
        until(lambda: len(robot.commands()) == 20)
        last_ns = robot.commands()[-1]
        rested_ns = robot.rested_ns(last_ns)
        assert 240 * MS < rested_ns - last_ns < 450 * MS


def test_stopped_daemon(tmp_path: Path) -> None:
    """SIGSTOP is silence too; after two seconds it is killed."""
    with running(tmp_path) as robot:
        robot.drive()
        stopped_ns = robot.kill("daemon", signal.SIGSTOP)
        assert robot.rested_ns(stopped_ns) - stopped_ns < 450 * MS
        until(lambda: len(robot.pids("daemon")) == 2)
        assert _is_gone(robot.pids("daemon")[0])
        assert "the daemon was silent, and was killed" in _log(tmp_path)


def test_killed_guard(tmp_path: Path) -> None:
    """The pins keep their levels; the supervisor puts them to rest, before anything else."""
    with running(tmp_path) as robot:
        robot.drive()
        killed_ns = robot.kill("hardware", signal.SIGKILL)
        assert robot.rested_ns(killed_ns, robot.process.pid) - killed_ns < 1_000 * MS
        until(lambda: len(robot.pids("hardware")) == 2)
        assert robot.record.is_at_rest()


def test_stopped_guard(tmp_path: Path) -> None:
    """A guard whose heart is silent is killed, and the pins are put to rest for it."""
    with running(tmp_path) as robot:
        robot.drive()
        guard = robot.pids("hardware")[0]
        stopped_ns = robot.kill("hardware", signal.SIGSTOP)
        assert robot.rested_ns(stopped_ns, robot.process.pid) - stopped_ns < 3_500 * MS
        assert _is_gone(guard)


def test_killed_supervisor(tmp_path: Path) -> None:
    """Guard and daemon notice, and end; nothing stays that nobody supervises."""
    with running(tmp_path) as robot:
        robot.drive()
        guard = robot.pids("hardware")[0]
        killed_ns = robot.record.lines()[-1]["t"]
        robot.process.kill()
        assert robot.rested_ns(killed_ns, guard) - killed_ns < 1_000 * MS
        until(lambda: all(map(_is_gone, (guard, *robot.pids("daemon")))))
        assert robot.record.is_at_rest()


def test_a_supervisor_that_was_stopped_too_does_not_blame_the_others(tmp_path: Path) -> None:
    """After Ctrl-Z and `fg` the hearts have been silent because nobody listened."""
    with running(tmp_path) as robot:
        robot.drive()
        os.kill(robot.process.pid, signal.SIGSTOP)
        count = len(robot.commands())
        until(lambda: len(robot.commands()) > count + 50)
        os.kill(robot.process.pid, signal.SIGCONT)
        until(lambda: len(robot.commands()) > count + 80)
        assert len(robot.pids("hardware")) == 1


def test_it_gives_up_when_they_fail_too_often(tmp_path: Path) -> None:
    """A daemon that cannot start is not started for ever."""
    with running(tmp_path, record="/nowhere/record") as robot:
        assert robot.process.wait(60) == 1
        assert robot.record.is_at_rest()
    assert "gives up: the daemon is gone, once too often." in _log(tmp_path)


def test_a_stuck_output_is_said_to_be_unsafe(tmp_path: Path) -> None:
    """Everything else rests, and the exit code says that one output does not obey."""
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


def test_what_does_not_obey_is_told_to_rest_again_and_again(tmp_path: Path) -> None:
    """Nothing starts and nothing ends before all outputs are at rest."""
    with running(tmp_path) as robot:
        robot.drive()
        (tmp_path / "stuck-GPIO22").touch()
        robot.kill("hardware", signal.SIGKILL)

        def attempts() -> int:
            lines = robot.record.lines()
            return sum(
                x.get("opened") == "hardware" and x["pid"] == robot.process.pid for x in lines
            )

        until(lambda: attempts() > 8)  # More than there may be restarts.
        assert len(robot.pids("hardware")) == 1
        mended_ns = robot.record.lines()[-1]["t"]
        (tmp_path / "stuck-GPIO22").unlink()
        assert robot.rested_ns(mended_ns, robot.process.pid) - mended_ns < 2_000 * MS
        until(lambda: len(robot.pids("hardware")) == 2)
    assert _log(tmp_path).count("NOT SAFE") == 1


def test_outputs_that_no_guard_ever_had_are_not_waited_for(tmp_path: Path) -> None:
    """A robot that is not wired as its profile says is told of, and ends."""
    (tmp_path / "stuck-GPIO22").touch()
    with running(tmp_path) as robot:
        assert robot.process.wait(30) == 3
    assert re.search("gives up: .* is gone, and not all outputs are at rest.", _log(tmp_path))


class _Stuck:
    """A guard that is stuck in the kernel: SIGKILL ends it only after a while."""

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
        raise AssertionError(f"{name}: it was killed already; every moment counts.")


class _Daemon(_Stuck):
    """A daemon that ends when it is told to."""

    name = "daemon"

    def terminate(self) -> None:
        self.code = 0

    def end(self, at_most_s: float, reap_s: float) -> None:
        self.code = 0


@contextlib.contextmanager
def _supervisor(told: str) -> Iterator[Supervisor]:
    """One without processes."""
    log = logging.getLogger("test")
    one = Supervisor(ServePlan(quick_car(), {}), -1, ProcessCommands((), ()), log)
    one._end_reason = told
    with one._woken, one._waker:
        yield one


@pytest.mark.parametrize("told", ["", "ended by SIGTERM"])
def test_a_guard_stuck_in_the_kernel_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch, told: str
) -> None:
    """The pins rest at once, and once more when it is gone: it may still have written."""
    attempts: list[int | None] = []
    guard = _Stuck(looks=4)

    def safe(plan: GuardPlan, hardware: Hardware) -> list[str]:
        attempts.append(guard.code)
        return ["Output drive: GPIO22 is busy"] if len(attempts) == 1 else []

    monkeypatch.setattr(supervisor, "make_safe", safe)
    monkeypatch.setattr(supervisor, "_AGAIN_S", 0.0)
    with _supervisor(told) as one:
        one._stop(guard, _Daemon(looks=9))
    assert attempts == [None, None, None, -9]
    assert one._is_safe


def test_a_guard_that_never_ends_is_given_up_when_told_to_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And the outputs are not said to be safe."""
    monkeypatch.setattr(supervisor, "make_safe", lambda plan, hardware: [])
    monkeypatch.setattr(supervisor, "_AGAIN_S", 0.0)
    monkeypatch.setattr(supervisor, "_UNSAFE_S", 0.01)
    with _supervisor("ended by SIGTERM") as one:
        one._stop(_Stuck(looks=10**9), _Daemon(looks=9))
    assert not one._is_safe


def test_garbage_is_counted_and_refused_in_words(tmp_path: Path) -> None:
    """A datagram that is no order never ends the guard."""
    garbage = ["{", "[]", '{"kind": "command", "values": [1e999]}', "x" * 20_000]
    with running(tmp_path, garbage=garbage) as robot:
        robot.drive()
        assert any("larger than 16384" in words for words in robot.notes("refused"))
        assert len(robot.pids("hardware")) == 1
    assert "4 datagrams were no orders" in _log(tmp_path)


def test_what_cannot_be_started_is_said_in_a_line(tmp_path: Path) -> None:
    """A driver that does not exist ends the supervisor before anything moves."""
    plan = quick_car(LimitPlan())
    plan = replace(plan, outputs=(replace(plan.outputs[0], driver="magic"),), sensors=())
    with running(tmp_path, plan) as robot:
        assert robot.process.wait(20) == 2
    assert "magic" in _log(tmp_path)
