"""Run the jobs of a study on a Ray cluster.

The study's folder must be on a file system that all nodes share, and the package be installed on
each of them. Ray sends Python objects between its nodes by pickle, so a cluster must be one that
only its users can reach.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import traceback
from collections.abc import Sequence
from typing import Any, Final

from shapechanger.errors import MissingExtra, ShapechangerError, StudyError
from shapechanger.transfer.executor import Job, JobSchedule, OnProgress, throttled

# Set before Ray is imported; otherwise Ray reports usage statistics.
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")

try:
    import ray
    from ray.exceptions import RayError
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy
except ImportError as error:
    raise MissingExtra("ray", "ray") from error

_CONNECT_S: Final = 2.0
_ANSWER_S: Final = 8.0
_REPORT_EVERY_S: Final = 0.5
_ray: Any = ray


class RayCluster:
    """Runs jobs on the nodes of a Ray cluster, one job per core.

    A job whose worker or node is lost is repeated on another; see `JobSchedule`.

    Args:
        address: Address of a running cluster, such as `10.0.0.1:6379`, or "auto" for the one that
            this machine is a node of; None to start Ray on this machine for the time of the study.
    """

    def __init__(self, address: str | None = None) -> None:
        self._address = address

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs; see `Executor.run`.

        Raises:
            StudyError: If the cluster does not answer.
            FailedRuns: If jobs have failed; all others are complete.
            OutputError: If a job could not write its result; the others are cancelled.
        """
        own = not _ray.is_initialized()
        if own:
            self._connect()
        try:
            _Session(jobs, on_progress).run()
        finally:
            if own:
                _ray.shutdown()

    def _connect(self) -> None:
        if self._address not in (None, "auto", "local"):
            _require_answer(str(self._address))
        try:
            _ray.init(address=self._address, logging_level="ERROR", log_to_driver=False)
        except (ConnectionError, ValueError, RuntimeError, RayError) as error:
            reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
            raise _no_answer(self._address or "this machine", reason) from error


def _require_answer(address: str) -> None:
    """Refuse an address at which no Ray answers; Ray itself would try for half a minute."""
    host, colon, port = address.rpartition(":")
    if not colon or not port.isdigit() or "/" in host:
        raise StudyError(f"The address of a Ray cluster is HOST:PORT or auto, not {address!r}.")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=_CONNECT_S).close()
    except (OSError, OverflowError) as error:
        raise _no_answer(address, "nothing listens there") from error
    command = [sys.executable, "-m", "ray.scripts.scripts", "health-check", "--address", address]
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=_ANSWER_S)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        raise _no_answer(address, "nothing there is healthy") from error


def _no_answer(address: str, reason: str) -> StudyError:
    return StudyError(
        f"Ray at {address} does not answer ({reason}): start it with `ray start --head`, or give "
        "the --address that it prints."
    )


class _Session:
    """The jobs that run on a cluster, and their steps."""

    def __init__(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        self._on_progress = on_progress
        self._schedule = JobSchedule(jobs)
        self._running: dict[Any, Job] = {}
        self._steps: dict[str, int] = {}
        self._board: Any = _new_board()
        self._perform: Any = _ray.remote(num_cpus=1, max_retries=0)(_perform)

    def run(self) -> None:
        """Run until every job has ended or cannot start."""
        try:
            while self._start_ready() or self._running:
                done, _ = _ray.wait(list(self._running), timeout=_REPORT_EVERY_S)
                self._report()
                for task in done:
                    self._finish(self._running.pop(task), task)
        except BaseException:
            for task in self._running:
                _ray.cancel(task, force=True)
            raise
        self._schedule.require_success()

    def _start_ready(self) -> bool:
        """Start the jobs whose dependencies have ended; return whether there were any."""
        ready = self._schedule.start()
        for job in ready:
            self._steps[job.name] = 0
            task = self._perform.remote(job.function, job.arguments, job.name, self._board)
            self._running[task] = job
        return bool(ready)

    def _finish(self, job: Job, task: Any) -> None:
        try:
            failure: ShapechangerError | str | None = _ray.get(task)
        except RayError as error:  # The worker or its node is gone.
            self._schedule.lose(job, type(error).__name__)
            return
        if failure is not None:
            self._schedule.fail(job, failure)
            return
        self._schedule.end(job)
        self._on_progress(job.name, self._steps[job.name], True)

    def _report(self) -> None:
        try:
            found: dict[str, int] = _ray.get(self._board.take.remote(), timeout=_ANSWER_S)
        except RayError:  # The board is being restarted; a study goes on without progress.
            return
        running = {job.name for job in self._running.values()}
        for name, steps in found.items():
            if name in running and steps != self._steps[name]:
                self._steps[name] = steps
                self._on_progress(name, steps, False)


def _new_board() -> Any:
    """Start the board on the node of this program, because other nodes may be lost."""
    here = NodeAffinitySchedulingStrategy(_ray.get_runtime_context().get_node_id(), soft=False)
    return _ray.remote(num_cpus=0, max_restarts=-1, scheduling_strategy=here)(_Board).remote()


class _Board:
    """Holds the steps of each job: a Ray actor."""

    def __init__(self) -> None:
        self._steps: dict[str, int] = {}

    def put(self, name: str, steps: int) -> None:
        """Store the steps of a job."""
        self._steps[name] = steps

    def take(self) -> dict[str, int]:
        """Return the steps of every job that has changed since the last call."""
        steps, self._steps = self._steps, {}
        return steps


def _perform(
    function: Any, arguments: tuple[Any, ...], name: str, board: Any
) -> ShapechangerError | str | None:
    """Perform a job on a node; return the error or the traceback if it failed."""
    try:
        function(
            *arguments, throttled(lambda steps: board.put.remote(name, steps), _REPORT_EVERY_S)
        )
    except ShapechangerError as error:
        return error
    except Exception:  # It crosses to the program that started the study.
        return traceback.format_exc()
    return None
