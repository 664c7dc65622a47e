"""Jobs in processes and on a Ray cluster of two nodes: order, failures and termination."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from shapechanger.errors import FailedRuns, OutputError, StudyError, UnknownName
from shapechanger.transfer.executor import Executor, Job, Processes, Serial
from shapechanger.transfer.ray_executor import RayCluster
from shapechanger.transfer.study import run_study
from tests.robot.client.robot import eventually
from tests.transfer import jobs
from tests.transfer.studies import tiny_plan

pytestmark = [pytest.mark.system, pytest.mark.filterwarnings("ignore::FutureWarning:ray")]

_ROOT = str(Path(__file__).parents[2])


@pytest.mark.parametrize("executor", [Serial(), Processes(2)], ids=["serial", "processes"])
def test_jobs_wait_for_those_before_them(executor: Executor, tmp_path: Path) -> None:
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


def test_serial_raises_the_error_of_a_job() -> None:
    with pytest.raises(UnknownName, match="No thing matches 'this'"):
        Serial().run([Job("refuse", jobs.refuse, ())], lambda *_: None)


def test_failed_jobs_are_reported_and_others_continue(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The message lists users' errors, bugs with tracebacks, lost processes and skipped jobs."""
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
    assert "These come after them: needs." in text
    assert "crash failed: ZeroDivisionError: a bug" in caplog.messages
    assert seen == ["others"]
    assert attempts.read_text() == "attempt\n" * 3
    assert mark.exists()
    assert not (tmp_path / "never").exists()


def test_a_lost_process_is_replaced(tmp_path: Path) -> None:
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
    """Other jobs do not start, because they could not write their results either."""
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


def test_processes_end_with_their_parent(tmp_path: Path) -> None:
    pid_file = tmp_path / "pid"
    code = f"from tests.transfer import jobs; jobs.run_for_ever({str(pid_file)!r})"
    environment = {**os.environ, "PYTHONPATH": _ROOT}
    script = tmp_path / "parent.py"
    script.write_text(f"if __name__ == '__main__':\n    {code}\n")
    parent = subprocess.Popen([sys.executable, str(script)], env=environment)
    try:
        eventually(lambda: pid_file.exists() and bool(pid_file.read_text()), 60.0)
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    child = int(pid_file.read_text())
    eventually(lambda: not _alive(child), 60.0)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat")
    return not (status.exists() and status.read_text().rsplit(")", 1)[1].split()[0] == "Z")


_MEMORY = 80_000_000
# Number of progress reports, two a second, after which the worker of a killed node has ended.
_UNTIL_DEAD = 6


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head node without cores, so that all jobs run on nodes that can be killed."""
    from ray.cluster_utils import Cluster

    # A lost node is noticed within two seconds; by default it takes half a minute.
    health = dict.fromkeys((f"health_check_{n}_ms" for n in ("period", "timeout")), 500)
    health |= {"health_check_initial_delay_ms": 500, "health_check_failure_threshold": 3}
    head = {"num_cpus": 0, "object_store_memory": _MEMORY, "_system_config": health}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", _ROOT, prepend=os.pathsep)  # Workers import the tests' jobs.
        nodes: Any = Cluster(initialize_head=True, head_node_args=head)
        nodes.add_node(num_cpus=1, object_store_memory=_MEMORY)
        yield nodes
        nodes.shutdown()


@pytest.mark.slow
def test_a_study_on_a_cluster_gives_equal_numbers(cluster: Any, tmp_path: Path) -> None:
    """The numbers equal a study in one process, and progress is reported."""
    seen: set[str] = set()
    plan = tiny_plan()
    there = run_study(
        plan,
        tmp_path / "there",
        executor=RayCluster(cluster.address),
        on_progress=lambda name, _, ended: seen.add(name) if ended else None,
    )
    here = run_study(plan, tmp_path / "here", executor=Serial())
    assert [run.curve for run in there.runs] == [run.curve for run in here.runs]
    assert seen == {run.name for run in plan.runs()}


@pytest.mark.slow
def test_a_job_of_a_killed_node_is_done_on_another(cluster: Any, tmp_path: Path) -> None:
    doomed = cluster.add_node(num_cpus=1, object_store_memory=_MEMORY)
    marks = [tmp_path / f"job-{i}" for i in range(2)]
    killed, since = False, 0

    def attempts() -> int:
        return sum(len(mark.read_text().splitlines()) for mark in marks if mark.exists())

    def on_progress(name: str, steps: int, ended: bool) -> None:
        nonlocal killed, since
        since += killed
        if attempts() == 2 and not killed:  # One on each node.
            killed = True
            cluster.remove_node(doomed, allow_graceful=False)
        if since == _UNTIL_DEAD:
            (tmp_path / "go").touch()

    RayCluster(cluster.address).run(
        [
            Job(mark.name, jobs.end_when_there_is_one, (str(mark), str(tmp_path / "go")))
            for mark in marks
        ],
        on_progress,
    )
    assert killed
    assert attempts() == 3


@pytest.mark.timeout(60)  # Ray itself would retry for longer.
@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("127.0.0.1:9", "does not answer (no program listens there)"),
        ("127.0.0.1:99999", "does not answer (no program listens there)"),
        ("nowhere", "HOST:PORT"),
        ("ray://127.0.0.1:9", "HOST:PORT"),
    ],
)
def test_a_wrong_address_is_refused(address: str, text: str) -> None:
    with pytest.raises(StudyError, match=re.escape(text)):
        RayCluster(address).run([], lambda *_: None)
