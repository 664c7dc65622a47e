"""Pins rest when processes are killed, stopped or silent, with real processes and signals.

Each time limit is the promised one plus the time for which the machine did not run a process.
"""

import contextlib
import logging
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from shapechanger.contract.plan import LimitPlan
from shapechanger.robot.guard import supervisor
from shapechanger.robot.guard.running import ServePlan
from shapechanger.robot.guard.supervisor import Restarts, Supervisor
from shapechanger.robot.twin.check.faults import FAULTS
from tests.robot.guard.plans import MS, quick_car
from tests.robot.guard.running import running, until
from tests.robot.witness import MARGIN_MS, Witness

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
    said = [line for line in _log(tmp_path).splitlines() if line.startswith("guard: ")]
    assert said[0] == "guard: guards test car with 2 outputs."
    assert said[-1] == "guard: ends: ended by SIGTERM."


def test_the_daemon_can_end_the_robot(tmp_path: Path) -> None:
    with running(tmp_path, commands=5, ends=True) as robot:
        assert robot.process.wait(20) == 0
        assert robot.record.is_at_rest()


@pytest.fixture(scope="module")
def delay_ms() -> Iterator[Callable[[], float]]:
    """A margin plus the longest delays of the guard and of the others since the last call, ms."""
    with contextlib.ExitStack() as stack:
        close = contextlib.closing
        witnesses = [stack.enter_context(close(Witness(one))) for one in ("guard", "normal")]
        yield lambda: MARGIN_MS + sum(witness.longest_ms() for witness in witnesses)


@pytest.mark.parametrize(
    "fault", ["daemon killed", "daemon stopped", "guard killed", "guard stopped"]
)
def test_pins_rest_after_a_process_was_killed_or_stopped(
    tmp_path: Path, delay_ms: Callable[[], float], fault: str
) -> None:
    """If the guard fails, the supervisor rests the pins; a restart does not clear the stop."""
    victim = "daemon" if "daemon" in fault else "hardware"
    number = signal.SIGSTOP if "stopped" in fault else signal.SIGKILL
    with running(tmp_path) as robot:
        robot.drive()
        guard, gone = robot.pids("hardware")[0], robot.pids(victim)[0]
        delay_ms()
        at_ns = robot.kill(victim, number)
        rests = guard if victim == "daemon" else robot.process.pid
        rested_ms = (robot.rested_ns(at_ns, rests) - at_ns) / MS
        assert rested_ms < FAULTS[fault].limit_ms(LimitPlan()) + delay_ms()
        until(lambda: len(robot.pids("daemon")) == len(robot.pids("hardware")) == 2)
        assert all(map(_is_gone, (guard, gone)))
        assert robot.record.is_at_rest()
        text = "guard: Emergency stop: the robot's processes failed and started afresh."
        until(lambda: text in _log(tmp_path))
    assert ("was silent, and was killed" in _log(tmp_path)) == (number is signal.SIGSTOP)


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
        os.kill(robot.pids("daemon")[0], signal.SIGSTOP)  # At the deadline the pins must rest.
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


def _child(name: str, polls: int) -> Mock:
    """A killed child that is stuck in the kernel, and exits after some polls."""
    child = Mock(killed=True, has_beaten=True, code=None)
    child.name = name

    def has_ended() -> bool:
        if child.has_ended.call_count >= polls:
            child.code = -9
        return child.code is not None

    child.has_ended.side_effect = has_ended
    return child


@pytest.fixture
def safe(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """A `make_safe` that succeeds without hardware; the supervisor's waits are shortened."""
    safe = Mock(return_value=[])
    monkeypatch.setattr(supervisor, "make_safe", safe)
    monkeypatch.setattr(supervisor, "_AGAIN_S", 0.0)
    monkeypatch.setattr(supervisor, "_UNSAFE_S", 0.05)
    return safe


def _stopped(guard: Mock, end_reason: str = "", **daemon: object) -> bool:
    """Stop the children of a supervisor, and return whether the outputs are at rest."""
    one = Supervisor(ServePlan(quick_car(), daemon), -1, logging.getLogger("test"))
    one._end_reason = end_reason
    with one._woken, one._waker:
        one._stop(guard, _child("daemon", 9))
    assert not guard.kill.called
    assert not guard.end.called
    return one._is_safe


@pytest.mark.parametrize("end_reason", ["", "ended by SIGTERM"])
def test_a_guard_stuck_in_the_kernel_is_not_waited_for(safe: Mock, end_reason: str) -> None:
    """The outputs are put to rest repeatedly, and once more after the guard has exited."""
    guard, codes = _child("guard", 4), list[int | None]()

    def make_safe(*_: object) -> list[str]:
        codes.append(guard.code)
        return ["Output drive: GPIO22 is busy"] if len(codes) == 1 else []

    safe.side_effect = make_safe
    assert _stopped(guard, end_reason)
    assert codes == [None, None, None, -9]


@pytest.mark.usefixtures("safe")
def test_the_supervisor_gives_up_on_a_guard_that_never_exits() -> None:
    assert not _stopped(_child("guard", 10**9), "ended by SIGTERM")


@pytest.mark.usefixtures("safe")
@pytest.mark.parametrize("name", ["ready.json", "folder"])
def test_the_ready_file_is_removed_when_its_daemon_ends(
    caplog: pytest.LogCaptureFixture, tmp_path: Path, name: str
) -> None:
    (tmp_path / "ready.json").write_text("{}")
    (tmp_path / "folder").mkdir()
    assert _stopped(_child("guard", 0), ready_file=str(tmp_path / name))
    assert (tmp_path / "ready.json").exists() == (name == "folder")
    assert ("cannot be removed" in caplog.text) == (name == "folder")


def test_an_unknown_driver_ends_the_supervisor(tmp_path: Path) -> None:
    plan = quick_car()
    plan = replace(plan, outputs=(replace(plan.outputs[0], driver="magic"),), sensors=())
    with running(tmp_path, plan) as robot:
        assert robot.process.wait(20) == 2
    assert "magic" in _log(tmp_path)


def test_restarts_are_limited_per_period_and_back_off() -> None:
    restarts = Restarts(most=2, within_s=60.0)
    times = (0, 30, 59, 60, 61, 90)
    assert [t for t in times if restarts.may_restart(t * 10**9)] == [0, 30, 60, 90]
    restarts = Restarts()
    pauses = [restarts.pause_s for t in range(5) if restarts.may_restart(t)]
    assert pauses == pytest.approx([0.0, 0.2, 0.6, 1.4, 3.0])
