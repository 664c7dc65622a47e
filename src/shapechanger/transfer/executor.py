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
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Final, Protocol

from shapechanger.errors import FailedRuns, OutputError, ShapechangerError, StudyError

_REPORT_EVERY_S: Final = 0.25
_log = logging.getLogger(__name__)

# Called in the job with the number of steps done.
ReportSteps = Callable[[int], None]
# Called in the parent: name of the job, steps done, whether it has ended.
OnProgress = Callable[[str, int, bool], None]


@dataclass(frozen=True)
class Job:
    """A function call to run in a separate process.

    Attributes:
        name: Its unique name.
        function: Called with `arguments` and a `ReportSteps`; a module-level function, so that
            another process can import it.
        arguments: Its arguments; must be picklable.
        after: Names of the jobs that must end before it starts.
        attempts: Times that it is tried while its process is lost; one that raises is not repeated.
    """

    name: str
    function: Callable[..., None]
    arguments: tuple[Any, ...]
    after: tuple[str, ...] = ()
    attempts: int = 3


class Executor(Protocol):
    """Runs jobs."""

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs in order of their dependencies.

        Args:
            jobs: The jobs.
            on_progress: Called with the progress of each.
        """
        ...


class JobSchedule:
    """Jobs that wait, have ended and have failed, in order of their dependencies.

    A job that fails does not stop the others, except those that need its result. One whose process
    is lost is repeated.
    """

    def __init__(self, jobs: Sequence[Job]) -> None:
        self._waiting = list(jobs)
        self._ended = {name for job in jobs for name in job.after} - {job.name for job in jobs}
        self._failed: dict[str, list[str]] = {}  # Names of jobs by reason.
        self._lost: Counter[str] = Counter()

    def start(self, most: int | None = None) -> list[Job]:
        """Return jobs whose dependencies have ended; they wait no longer.

        Args:
            most: Number of jobs to return at most; None for all.
        """
        ready = [job for job in self._waiting if self._ended.issuperset(job.after)][:most]
        for job in ready:
            self._waiting.remove(job)
        return ready

    def end(self, job: Job) -> None:
        """Record that a job has ended."""
        self._ended.add(job.name)

    def fail(self, job: Job, error: ShapechangerError | str) -> None:
        """Record that a job has failed."""
        if isinstance(error, OutputError):
            raise error
        reason = str(error).strip().rstrip(".")
        self._failed.setdefault(reason, []).append(job.name)
        # At once, because the others may take hours.
        _log.error("%s failed: %s", job.name, reason.rpartition("\n")[2])

    def lose(self, job: Job, how: str) -> None:
        """Record that a job's process has ended by itself; the job waits again, or has failed."""
        self._lost[job.name] += 1
        if self._lost[job.name] < job.attempts:
            self._waiting.append(job)
        else:
            times = "once" if job.attempts == 1 else f"{job.attempts} times, at last"
            self.fail(job, f"its process was lost {times} with {how}")

    def require_success(self) -> None:
        """Raise if jobs have failed."""
        if not self._failed:
            return
        reasons = "; ".join(
            f"{', '.join(names)} ({reason})" for reason, names in self._failed.items()
        )
        skipped = ", ".join(job.name for job in self._waiting)
        raise FailedRuns(
            f"These runs failed: {reasons}. "
            + (f"These need them: {skipped}. " if skipped else "")
            + "All others have ended; the same command tries these again."
        )


def throttled(report: ReportSteps, every_s: float) -> ReportSteps:
    """Return a callback that forwards only some of the numbers: a run makes thousands."""
    last = 0.0

    def forward(steps: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= every_s:
            last = now
            report(steps)

    return forward


class Serial:
    """Runs jobs one after another in this process, for debugging; raises what the first raises."""

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs; see `Executor.run`."""
        schedule = JobSchedule(jobs)
        while ready := schedule.start(1):
            job = ready[0]

            def report(steps: int, name: str = job.name) -> None:
                on_progress(name, steps, False)

            job.function(*job.arguments, report)
            schedule.end(job)
            on_progress(job.name, 0, True)


class Processes:
    """Runs jobs in worker processes of this machine, which end with their parent.

    Processes are spawned, not forked: a script that calls this must guard its start with
    `if __name__ == "__main__":`.

    Args:
        workers: Number of processes; None for one per core.
    """

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise StudyError(f"A study needs at least one worker, got {workers}.")
        self._workers = workers or os.cpu_count() or 1

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs; see `Executor.run` and `JobSchedule`.

        Raises:
            FailedRuns: If jobs have failed; all others are complete.
            OutputError: If a job could not write its result; the others are ended.
        """
        schedule = JobSchedule(jobs)
        idle: list[_Worker] = []
        busy: dict[Connection, _Worker] = {}
        try:
            while True:
                for job in schedule.start(self._workers - len(busy)):
                    worker = idle.pop() if idle else _Worker()
                    busy[worker.connection] = worker
                    worker.begin(job)
                if not busy:
                    break
                for connection in wait(list(busy)):
                    worker = busy[connection]  # pyright: ignore[reportArgumentType]
                    kind, content = worker.receive()
                    if kind == "steps":
                        worker.steps = content
                        on_progress(worker.job.name, worker.steps, False)
                        continue
                    del busy[worker.connection]
                    if kind == "lost":
                        schedule.lose(worker.job, f"exit code {worker.end()}")
                        continue
                    idle.append(worker)
                    if kind == "failed":
                        schedule.fail(worker.job, content)
                        continue
                    schedule.end(worker.job)
                    on_progress(worker.job.name, worker.steps, True)
        finally:
            for worker in (*idle, *busy.values()):
                worker.end()
        schedule.require_success()


class _Worker:
    """A process that runs jobs one after another."""

    job: Job

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self.steps = 0

    def begin(self, job: Job) -> None:
        self.job, self.steps = job, 0
        with suppress(ConnectionError):  # A process that has ended is noticed when it is heard.
            self.connection.send((job.function, job.arguments))

    def receive(self) -> tuple[str, Any]:
        """Receive "steps" with their number, "failed" with the error, "ended" or "lost"."""
        try:
            return self.connection.recv()
        except (EOFError, ConnectionError):  # The latter if it has not read its job.
            return "lost", None

    def end(self) -> int | None:
        """End the process, and return its exit code; negative for a signal."""
        self._process.terminate()
        self._process.join()
        self.connection.close()
        return self._process.exitcode


def _serve(connection: Connection) -> None:
    """Run jobs as they arrive, until the parent is gone."""
    # Ctrl-C reaches every process of the terminal; the parent handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    report = throttled(lambda steps: connection.send(("steps", steps)), _REPORT_EVERY_S)
    while True:
        try:
            function, arguments = connection.recv()
        except EOFError:
            return
        try:
            function(*arguments, report)
        except ShapechangerError as error:
            connection.send(("failed", error))
        except Exception:  # It crosses to the parent, which reports it.
            connection.send(("failed", traceback.format_exc()))
        else:
            connection.send(("ended", None))


def _end_with_parent() -> None:
    """End this process when its parent ends, even by SIGKILL."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def use_one_thread() -> None:
    """Limit PyTorch in this process to one thread.

    Networks this small gain nothing from more, several runs share the machine, and sums in another
    order are other sums.
    """
    import torch  # It takes seconds to load, and plans and reports need none of it.

    torch.set_num_threads(1)
