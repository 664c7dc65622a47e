"""Running jobs in processes of this machine: some at a time, each after those that it waits for."""

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

__all__ = ["Executor", "Job", "OnProgress", "Processes", "ReportSteps", "Serial"]

_REPORT_EVERY_S: Final = 0.25

# Called in the job with the number of steps done.
ReportSteps = Callable[[int], None]
# Called in the parent: name of the job, steps done, whether it has ended.
OnProgress = Callable[[str, int, bool], None]


@dataclass(frozen=True)
class Job:
    """Something to run in a process of its own.

    Attributes:
        name: Its name, unlike any other's.
        function: What to call, with `arguments` and a `ReportSteps`; a function of a module, so that
            another process finds it.
        arguments: Its arguments, which another process must be able to receive.
        after: Names of jobs that must have ended before.
    """

    name: str
    function: Callable[..., None]
    arguments: tuple[Any, ...]
    after: tuple[str, ...] = ()


class Executor(Protocol):
    """Runs jobs somewhere."""

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs, each after those that it waits for; raise what one of them raised."""
        ...


class Serial:
    """Runs jobs one after another in this process: slower, and easy to look into."""

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs; what one of them raises ends the others."""
        ended: set[str] = {name for job in jobs for name in job.after} - {job.name for job in jobs}
        waiting = list(jobs)
        while waiting:
            job = next(job for job in waiting if ended.issuperset(job.after))
            waiting.remove(job)
            job.function(*job.arguments, _reporting(job.name, on_progress))
            ended.add(job.name)
            on_progress(job.name, 0, True)


def _reporting(name: str, on_progress: OnProgress) -> ReportSteps:
    """A report that passes on the steps under the job's name."""
    return lambda steps: on_progress(name, steps, False)


class Processes:
    """Runs jobs in a few processes of this machine, which end with their parent.

    Processes are spawned, not forked: a script that calls this must guard its start with
    `if __name__ == "__main__":`.

    Args:
        workers: How many at a time; None for as many as the machine has cores.
    """

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise StudyError(f"A study needs at least one worker, got {workers}.")
        self._workers = workers or os.cpu_count() or 1

    def run(self, jobs: Sequence[Job], on_progress: OnProgress) -> None:
        """Run all jobs; the first that fails ends the others and is raised.

        Raises:
            ShapechangerError: What a job raised, or a `StudyError` that holds its traceback.
        """
        waiting = list(jobs)
        ended = {name for job in jobs for name in job.after} - {job.name for job in jobs}
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
    """One process that does jobs one after another."""

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
        self.connection.send((job.function, job.arguments))

    def receive(self) -> bool:
        """Take in one message; whether the job has ended."""
        try:
            kind, content = self.connection.recv()
        except EOFError:
            self._process.join()
            raise StudyError(
                f"The process of {self.job_name} ended by itself with exit code "
                f"{self._process.exitcode}; runs that had ended are kept."
            ) from None
        if kind == "failed":
            raise content
        if kind == "crashed":
            raise StudyError(f"{self.job_name} failed:\n{content}")
        if kind == "steps":
            self.steps = content
        return kind == "ended"

    def end(self) -> None:
        self._process.terminate()
        self._process.join()
        self.connection.close()


def _serve(connection: Connection) -> None:
    """Do jobs as they come, until the parent is gone."""
    # Ctrl-C reaches every process of the terminal; the parent decides what ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            function, arguments = connection.recv()
        except EOFError:
            return
        try:
            function(*arguments, _throttled(connection))
        except ShapechangerError as error:
            connection.send(("failed", error))
        except Exception:  # It crosses to the parent, which raises it.
            connection.send(("crashed", traceback.format_exc()))
        else:
            connection.send(("ended", None))


def _throttled(connection: Connection) -> ReportSteps:
    """A report that passes on a few numbers a second: a run makes thousands."""
    last = 0.0

    def report(steps: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _REPORT_EVERY_S:
            last = now
            connection.send(("steps", steps))

    return report


def _end_with_parent() -> None:
    """End this process when its parent ends, even by SIGKILL: nobody would take its results."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
