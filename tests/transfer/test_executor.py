"""Jobs in processes: order, failures and termination."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from shapechanger.errors import FailedRuns, OutputError, StudyError, UnknownName
from shapechanger.transfer.executor import Executor, Job, Processes, Serial
from tests.transfer import jobs

pytestmark = pytest.mark.system

EXECUTORS = [Serial(), Processes(2)]


def await_(condition: object, timeout_s: float = 60.0) -> None:
    """Wait until `condition()` is true, or fail."""
    assert callable(condition)
    end = time.monotonic() + timeout_s
    never = threading.Event()
    while not condition():
        assert time.monotonic() < end, "waited too long"
        never.wait(0.01)


@pytest.mark.parametrize("executor", EXECUTORS, ids=["serial", "processes"])
def test_jobs_wait_for_those_before_them(executor: Executor, tmp_path: Path) -> None:
    """A job starts after those that it depends on, whatever the order of the list."""
    names = ("last", "middle", "first")
    marks = {name: tmp_path / name for name in names}
    waits = {"last": ("middle",), "middle": ("first",), "first": ()}
    seen: list[str] = []
    executor.run(
        [Job(name, jobs.leave_a_mark, (str(marks[name]),), waits[name]) for name in names],
        lambda name, steps, ended: seen.append(name) if ended else None,
    )
    ended = {name: int(mark.read_text()) for name, mark in marks.items()}
    assert ended["first"] < ended["middle"] < ended["last"]
    assert seen == ["first", "middle", "last"]


def test_in_this_process_an_error_comes_back_as_it_was() -> None:
    with pytest.raises(UnknownName, match="No thing matches 'this'"):
        Serial().run([Job("refuse", jobs.refuse, ())], lambda *_: None)


def test_failed_jobs_are_reported_and_others_continue(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Users' errors, bugs with their tracebacks, lost processes, and the jobs that need them."""
    mark, attempts = tmp_path / "mark", tmp_path / "attempts"
    seen: list[str] = []
    with pytest.raises(FailedRuns) as caught:
        Processes(1).run(
            [
                Job("refuse", jobs.refuse, ()),
                Job("again", jobs.refuse, ()),
                Job("crash", jobs.crash, ()),
                Job("vanish", jobs.vanish, (str(attempts),)),
                Job("needs", jobs.leave_a_mark, (str(tmp_path / "never"),), ("refuse",)),
                Job("others", jobs.leave_a_mark, (str(mark),)),
            ],
            lambda name, steps, ended: seen.append(name) if ended else None,
        )
    text = str(caught.value)
    assert "refuse, again (No thing matches 'this'" in text
    assert "crash (Traceback" in text
    assert "ZeroDivisionError: a bug" in text
    assert "vanish (its process was lost 3 times, at last with exit code -9)" in text
    assert "These need them: needs." in text
    assert "crash failed: ZeroDivisionError: a bug" in caplog.messages
    assert seen == ["others"]
    assert attempts.read_text() == "attempt\n" * 3
    assert mark.exists()
    assert not (tmp_path / "never").exists()


def test_a_lost_process_is_replaced(tmp_path: Path) -> None:
    """A job whose process was killed once ends in another."""
    mark = tmp_path / "mark"
    Processes(1).run([Job("vanish", jobs.vanish_once, (str(mark),))], lambda *_: None)
    assert mark.read_text() == "attempt\nattempt\n"


def test_a_job_of_one_attempt_is_not_repeated(tmp_path: Path) -> None:
    """A robot must not move again by itself."""
    mark = tmp_path / "mark"
    job = Job("vanish", jobs.vanish, (str(mark),), attempts=1)
    with pytest.raises(FailedRuns, match=r"vanish \(its process was lost once with exit code -9"):
        Processes(1).run([job], lambda *_: None)
    assert mark.read_text() == "attempt\n"


def test_a_full_disk_ends_all_jobs(tmp_path: Path) -> None:
    """No other job could write its result either."""
    mark = tmp_path / "mark"
    with pytest.raises(OutputError, match="No space left"):
        Processes(1).run(
            [Job("full", jobs.fill_the_disk, ()), Job("next", jobs.leave_a_mark, (str(mark),))],
            lambda *_: None,
        )
    assert not mark.exists()


def test_a_script_without_a_guarded_start_is_reported(tmp_path: Path) -> None:
    """Workers end before they read their jobs, which resets the connections."""
    script = tmp_path / "unguarded.py"
    script.write_text(
        "from shapechanger.transfer.executor import Job, Processes\n"
        "Processes(1).run([Job('sum', sum, ([],))], lambda *_: None)\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    last = done.stderr.splitlines()[-1]
    assert "sum (its process was lost 3 times, at last with exit code 1)" in last


def test_no_workers_are_refused() -> None:
    with pytest.raises(StudyError, match="at least one worker, got 0"):
        Processes(0)


def test_processes_end_with_their_parent(tmp_path: Path) -> None:
    pid_file = tmp_path / "pid"
    code = f"from tests.transfer import jobs; jobs.run_for_ever({str(pid_file)!r})"
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    main = f"if __name__ == '__main__':\n    {code}\n"
    script = tmp_path / "parent.py"
    script.write_text(main)
    parent = subprocess.Popen([sys.executable, str(script)], env=environment)
    try:
        await_(lambda: pid_file.exists() and pid_file.read_text())
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    child = int(pid_file.read_text())
    await_(lambda: not _alive(child))


def _alive(pid: int) -> bool:
    """Return whether a process runs; a zombie does not."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat")
    return not (status.exists() and status.read_text().rsplit(")", 1)[1].split()[0] == "Z")
