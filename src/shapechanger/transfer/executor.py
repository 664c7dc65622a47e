"""Run jobs with dependencies, serially or in processes of this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Final, Protocol

from shapechanger.errors import ShapechangerError, StudyError

_REPORT_EVERY_S: Final = 0.25

# Called in the job with the number of steps done.
ReportSteps = Callable[[int], None]
# Called in the parent: name of the job, steps done, whether it has ended.
OnProgress = Callable[[str, int, bool], None]


@dataclass(frozen=True)
class Job:
    """A function call to run in a process of its own.

    Attributes:
        name: Its unique name.
        function: Called with `arguments` and a `ReportSteps`; a module-level function, so that
            another process can import it.
        arguments: Its arguments; must be picklable.
        after: Names of the jobs that must end before it starts.
    """

    name: str
    function: Callable[..., None]
    arguments: tuple[Any, ...]
    after: tuple[str, ...] = ()


class Executor(Protocol):
    """Runs jobs."""

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs in order of their dependencies; raise what one of them raised.

        Args:
            jobs: The jobs.
            on_progress: Called with the progress of each.
        """
        ...


def done_before(jobs: Sequence[Job]) -> set[str]:
    """Return the names that jobs wait for but that are not among them: those have ended."""
    return {name for job in jobs for name in job.after} - {job.name for job in jobs}


def throttled(report: ReportSteps, every_s: float) -> ReportSteps:
    """Return a callback that forwards only some of the numbers: a run makes thousands.

    Args:
        report: Called with the numbers that are forwarded.
        every_s: Least time between two of them, s.
    """
    last = 0.0

    def forward(steps: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= every_s:
            last = now
            report(steps)

    return forward


class Serial:
    """Runs jobs one after another in this process, for debugging."""

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs; see `Executor.run`."""
        ended = done_before(jobs)
        waiting = list(jobs)
        while waiting:
            job = next(job for job in waiting if ended.issuperset(job.after))
            waiting.remove(job)

            def report(steps: int, name: str = job.name) -> None:
                on_progress(name, steps, False)

            job.function(*job.arguments, report)
            ended.add(job.name)
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
        """Run all jobs; see `Executor.run`. The first failure ends the others.

        Raises:
            ShapechangerError: What a job raised, or a `StudyError` with its traceback.
        """
        waiting = list(jobs)
        ended = done_before(jobs)
        idle = [_Worker() for _ in range(min(self._workers, len(jobs)))]
        busy: dict[Connection, _Worker] = {}
        try:
            while waiting or busy:
                ready = [job for job in waiting if ended.issuperset(job.after)]
                for job in ready[: len(idle)]:
                    worker = idle.pop()
                    worker.begin(job)
                    busy[worker.connection] = worker
                    waiting.remove(job)
                for connection in wait(list(busy)):
                    worker = busy[connection]  # pyright: ignore[reportArgumentType]
                    done = worker.receive()
                    on_progress(worker.job_name, worker.steps, done)
                    if done:
                        ended.add(worker.job_name)
                        idle.append(busy.pop(worker.connection))
        finally:
            for worker in (*idle, *busy.values()):
                worker.end()


class _Worker:
    """A process that runs jobs one after another."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self._process: BaseProcess = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self.job_name = ""
        self.steps = 0

    def begin(self, job: Job) -> None:
        self.job_name, self.steps = job.name, 0
        try:
            self.connection.send((job.function, job.arguments))
        except ConnectionError:
            raise self._ended() from None

    def receive(self) -> bool:
        """Receive one message; return whether the job has ended."""
        try:
            kind, content = self.connection.recv()
        except (EOFError, ConnectionError):  # The latter if it has not read its job.
            raise self._ended() from None
        if kind == "failed":
            raise content
        if kind == "crashed":
            raise StudyError(f"{self.job_name} failed:\n{content}")
        if kind == "steps":
            self.steps = content
        return kind == "ended"

    def _ended(self) -> StudyError:
        self._process.join()
        return StudyError(
            f"The process of {self.job_name} ended by itself with exit code "
            f"{self._process.exitcode}; runs that had ended are kept."
        )

    def end(self) -> None:
        self._process.terminate()
        self._process.join()
        self.connection.close()


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
        except Exception:  # It crosses to the parent, which raises it.
            connection.send(("crashed", traceback.format_exc()))
        else:
            connection.send(("ended", None))


def _end_with_parent() -> None:
    """End this process when its parent ends, even by SIGKILL."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
