"""Run jobs with dependencies, serially or in processes of this machine."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Final, Literal, cast

from shapechanger.errors import FailedRuns, OutputError, ShapechangerError, StudyError

_REPORT_EVERY_S: Final = 0.25
_log = logging.getLogger(__name__)

# Called in the job with the number of steps done.
ReportSteps = Callable[[int], None]
# Called in the parent: name of the job, steps done, whether it has ended.
OnProgress = Callable[[str, int, bool], None]


@dataclass(frozen=True)
class Job:
    """A call of a module-level function in a process, with `arguments` and a `ReportSteps`.

    The job starts when the jobs of the run that `after` names have succeeded. If its process is
    lost, the job starts again, up to `attempts` times in all; a job that raises is not repeated.
    """

    name: str
    function: Callable[..., None]
    arguments: tuple[Any, ...]
    after: tuple[str, ...] = ()
    attempts: int = 3


Event = tuple[str, Literal["steps", "done", "lost"], Any]
"""Name of a job, the kind of event, and its content: for "steps" the steps done so far, for "done"
the failure or None, and for "lost" how the process was lost."""


class Executor:
    """Runs jobs in the order of their dependencies; subclasses define where jobs run.

    If a job fails, the jobs after it are skipped, and the others run. If a job raises an
    `OutputError`, all jobs end. For lost processes, see `Job`.
    """

    # Maximum number of jobs that run at the same time; None for no limit.
    _most: int | None = None

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs in the order of their dependencies.

        Raises:
            FailedRuns: If jobs have failed; all jobs that do not depend on them are complete.
            OutputError: If a job could not write its result; all other jobs are stopped.
        """
        waiting, running = list(jobs), dict[str, Job]()
        ended = {name for job in jobs for name in job.after} - {job.name for job in jobs}
        failed: dict[str, list[str]] = {}  # Names of the failed jobs, keyed by reason.
        steps, lost = Counter[str](), Counter[str]()
        self._open(on_progress)
        try:
            while True:
                free = None if self._most is None else self._most - len(running)
                for job in [job for job in waiting if ended.issuperset(job.after)][:free]:
                    waiting.remove(job)
                    running[job.name], steps[job.name] = job, 0
                    self._begin(job)
                if not running:
                    break
                for name, kind, content in self._events():
                    if kind == "steps":
                        steps[name] = content
                        on_progress(name, content, False)
                        continue
                    job = running.pop(name)
                    if kind == "done" and content is None:
                        ended.add(name)
                        on_progress(name, steps[name], True)
                        continue
                    if isinstance(content, OutputError):
                        raise content
                    if kind == "lost":
                        lost[name] += 1
                        if lost[name] < job.attempts:
                            waiting.append(job)
                            continue
                        times = "once" if job.attempts == 1 else f"{job.attempts} times, at last"
                        content = f"its process was lost {times} with {content}"
                    reason = str(content).strip().rstrip(".")
                    failed.setdefault(reason, []).append(name)
                    # Logged at once, because the other jobs may take hours.
                    _log.error("%s failed: %s", name, reason.rpartition("\n")[2])
        finally:
            self._close()
        if failed:
            reasons = (f"{', '.join(names)} ({reason})" for reason, names in failed.items())
            skipped = ", ".join(job.name for job in waiting)
            raise FailedRuns(
                f"These runs failed: {'; '.join(reasons)}. "
                + (f"These come after them: {skipped}. " if skipped else "")
                + "All others have ended; the same command tries these again."
            )

    def _open(self, on_progress: OnProgress) -> None:
        """Prepare to run jobs."""

    def _begin(self, job: Job) -> None:
        raise NotImplementedError

    def _events(self) -> Iterable[Event]:
        """Wait for events of the running jobs, and return them; there may be none."""
        raise NotImplementedError

    def _close(self) -> None:
        """Stop all jobs that are still running."""


def throttled(report: ReportSteps, every_s: float) -> ReportSteps:
    """Return a callback that forwards a report at most every `every_s` s, and drops the others."""
    last = 0.0

    def forward(steps: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= every_s:
            last = now
            report(steps)

    return forward


def failure_of(
    function: Callable[..., None], arguments: tuple[Any, ...], report: ReportSteps
) -> ShapechangerError | str | None:
    """Perform a job; return its error or traceback, or None if it succeeds."""
    try:
        function(*arguments, report)
    except ShapechangerError as error:
        return error
    except Exception:  # As text, because not every exception can be pickled.
        return traceback.format_exc()
    return None


class Serial(Executor):
    """Runs jobs one after another in this process, for debugging; raises a job's exception."""

    _most = 1

    def _open(self, on_progress: OnProgress) -> None:
        self._on_progress = on_progress

    def _begin(self, job: Job) -> None:
        self._job = job

    def _events(self) -> Iterable[Event]:
        job = self._job

        def report(steps: int) -> None:
            self._on_progress(job.name, steps, False)

        job.function(*job.arguments, report)
        yield job.name, "done", None


class Processes(Executor):
    """Runs jobs in worker processes of this machine, which end with their parent.

    A script that uses this class must guard its entry point with `if __name__ == "__main__":`,
    because processes are spawned. At most `workers` run at once; None for one per core.
    """

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise StudyError(f"A study needs at least one worker, got {workers}.")
        self._most = workers or os.cpu_count() or 1
        self._idle: dict[Connection, BaseProcess] = {}
        self._busy: dict[Connection, tuple[BaseProcess, str]] = {}

    def _begin(self, job: Job) -> None:
        if self._idle:
            connection, process = self._idle.popitem()
        else:
            context = multiprocessing.get_context("spawn")
            connection, theirs = context.Pipe()
            process = context.Process(target=_serve, args=(theirs,), daemon=True)
            process.start()
            theirs.close()
        self._busy[connection] = process, job.name
        with suppress(ConnectionError):  # `_events` reports a process that has ended.
            connection.send((job.function, job.arguments))

    def _events(self) -> Iterable[Event]:
        for ready in wait(list(self._busy)):
            connection = cast("Connection", ready)
            process, job = self._busy[connection]
            try:
                kind, content = connection.recv()
            # ConnectionError if the process ended before it read its job.
            except (EOFError, ConnectionError):
                kind, content = "lost", f"exit code {_end(connection, process)}"
            if kind != "steps":
                del self._busy[connection]
                if kind != "lost":
                    self._idle[connection] = process
            yield job, kind, content

    def _close(self) -> None:
        busy = {connection: process for connection, (process, _) in self._busy.items()}
        for connection, process in (self._idle | busy).items():
            _end(connection, process)
        self._idle, self._busy = {}, {}


def _end(connection: Connection, process: BaseProcess) -> int | None:
    """End a worker, and return its exit code, which is negative for a signal."""
    process.terminate()
    process.join()
    connection.close()
    return process.exitcode


def _serve(connection: Connection) -> None:
    """Run jobs as they arrive, until the parent is gone."""
    # Ctrl-C reaches every process of the terminal, and the parent ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    report = throttled(lambda steps: connection.send(("steps", steps)), _REPORT_EVERY_S)
    while True:
        try:
            function, arguments = connection.recv()
        except EOFError:
            return
        connection.send(("done", failure_of(function, arguments, report)))


def _end_with_parent() -> None:
    """End this process when its parent ends, even by SIGKILL."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def use_one_thread() -> None:
    """Limit PyTorch in this process to one thread.

    More threads do not make small networks faster, several runs share the machine, and the rounding
    of sums depends on the number of threads.
    """
    import torch  # Takes seconds to load, and plans and reports do not need it.

    torch.set_num_threads(1)
