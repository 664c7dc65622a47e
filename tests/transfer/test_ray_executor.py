"""A study on a Ray cluster of two nodes on this machine."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from shapechanger.errors import StudyError
from shapechanger.transfer.executor import Job, Serial
from shapechanger.transfer.ray_executor import RayCluster
from shapechanger.transfer.study import run_study
from tests.transfer import jobs
from tests.transfer.studies import tiny_plan

pytestmark = [pytest.mark.system, pytest.mark.filterwarnings("ignore::FutureWarning:ray")]

_MEMORY = 80_000_000
# Reports of the other job, two a second, after which the worker of a killed node has ended.
_UNTIL_DEAD = 6


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head node without cores, so that all jobs run on nodes that can be killed."""
    from ray.cluster_utils import Cluster

    # Workers import the jobs of the tests.
    root = str(Path(__file__).parents[2])
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (root, before)))
    nodes: Any = Cluster(
        initialize_head=True,
        head_node_args={
            "num_cpus": 0,
            "object_store_memory": _MEMORY,
            # Notice a lost node within two seconds; by default it takes half a minute.
            "_system_config": {
                "health_check_initial_delay_ms": 500,
                "health_check_period_ms": 500,
                "health_check_timeout_ms": 500,
                "health_check_failure_threshold": 3,
            },
        },
    )
    nodes.add_node(num_cpus=1, object_store_memory=_MEMORY)
    yield nodes
    nodes.shutdown()
    if before is None:
        del os.environ["PYTHONPATH"]
    else:
        os.environ["PYTHONPATH"] = before


@pytest.mark.slow
def test_a_study_has_the_numbers_of_this_machine(cluster: Any, tmp_path: Path) -> None:
    """Equal seeds give equal numbers, and progress arrives."""
    seen: set[str] = set()

    def on_progress(name: str, steps: int, ended: bool) -> None:
        del steps
        if ended:
            seen.add(name)

    plan = tiny_plan()
    there = run_study(
        plan, tmp_path / "there", executor=RayCluster(cluster.address), on_progress=on_progress
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
        del name, steps, ended
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


@pytest.mark.slow
def test_a_failed_job_is_reported_and_others_continue(cluster: Any, tmp_path: Path) -> None:
    """Failed jobs, lost jobs and those that need them are named."""
    mark = tmp_path / "mark"
    with pytest.raises(StudyError) as caught:
        RayCluster(cluster.address).run(
            [
                Job("refuse", jobs.refuse, ()),
                Job("vanish", jobs.vanish, (str(tmp_path / "attempts"),)),
                Job("needs", jobs.leave_a_mark, (str(tmp_path / "never"),), ("refuse",)),
                Job("others", jobs.leave_a_mark, (str(mark),)),
            ],
            lambda *_: None,
        )
    text = str(caught.value)
    assert "refuse (No thing matches 'this'" in text
    assert "vanish (its process was lost 3 times" in text
    assert "These need them: needs." in text
    assert mark.exists()
    assert not (tmp_path / "never").exists()


@pytest.mark.timeout(60)  # Ray alone tries for longer.
@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("127.0.0.1:9", "does not answer (nothing listens there)"),
        ("127.0.0.1:99999", "does not answer (nothing listens there)"),
        ("nowhere", "HOST:PORT"),
        ("ray://127.0.0.1:9", "HOST:PORT"),
    ],
)
def test_an_address_that_does_not_answer_is_one_sentence(address: str, text: str) -> None:
    with pytest.raises(StudyError, match=re.escape(text)):
        RayCluster(address).run([], lambda *_: None)
