"""Threads that step the envs of a vector env, each its own envs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from queue import SimpleQueue
from typing import Final

Failures = list[tuple[int, Exception]]
"""Exceptions, each with the number of the env that raised it."""

_Job = Callable[[], None]

# How long to wait for a thread to end, s; it only has to finish a step.
_END_WITHIN_S: Final = 5.0


class _Token:
    """Comes back from a thread that has finished everything it was given before."""


class _Worker:
    """One thread, its jobs and its answers: None, the token, or what a job raised."""

    def __init__(self) -> None:
        self.inbox: SimpleQueue[_Job | _Token | None] = SimpleQueue()
        self.outbox: SimpleQueue[BaseException | _Token | None] = SimpleQueue()
        # A daemon thread, so that a program that does not close its envs can still exit.
        self.thread = threading.Thread(
            target=_serve, args=(self.inbox, self.outbox), name="shapechanger-vector", daemon=True
        )
        self.thread.start()


def _serve(
    inbox: SimpleQueue[_Job | _Token | None], outbox: SimpleQueue[BaseException | _Token | None]
) -> None:
    """Run jobs until None arrives."""
    while (job := inbox.get()) is not None:
        answer: BaseException | _Token | None = None
        if isinstance(job, _Token):
            answer = job
        else:
            try:
                job()
            except BaseException as error:  # It crosses to the caller, who raises it.
                answer = error
        del job  # A waiting thread must not keep the job's objects alive.
        outbox.put(answer)
        del answer


class ThreadPool:
    """Runs a few jobs in parallel: the first in the caller's thread, the others in their own.

    Threads start with the first run, and again in a forked process. A SimpleQueue stays consistent
    even when a signal interrupts the caller; a pair of locks does not.

    Args:
        threads: How many threads, including the caller's.

    Attributes:
        lost: Whether an interruption left threads running; do not touch what they work on.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.lost = False
        self._workers: list[_Worker] = []

    def run(self, jobs: Sequence[_Job]) -> None:
        """Run one job per thread; return, or raise, when all have ended.

        Raises:
            BaseException: The exception of the first job that failed.
        """
        if len(jobs) == 1:
            jobs[0]()
            return
        workers = self._awake()
        failures: list[BaseException] = []
        try:
            for worker, job in zip(workers, jobs[1:], strict=True):
                worker.inbox.put(job)
            jobs[0]()
            for worker in workers:
                answer = worker.outbox.get()
                if isinstance(answer, BaseException):
                    failures.append(answer)
        except BaseException:
            self._settle()
            raise
        if failures:
            raise failures[0]

    def stop(self) -> None:
        """End the threads; the next run starts new ones."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.inbox.put(None)
        for worker in workers:
            if worker.thread is not threading.current_thread():
                worker.thread.join(_END_WITHIN_S)

    def _awake(self) -> list[_Worker]:
        """Return the threads, started if they are not alive."""
        if not all(worker.thread.is_alive() for worker in self._workers):
            self._workers = []  # pragma: no cover  # After a fork; tested in a subprocess.
        while len(self._workers) < self.threads - 1:
            self._workers.append(_Worker())
        return self._workers

    def _settle(self) -> None:
        """Wait until all threads have finished whatever they were given.

        After an interruption it is unknown which jobs were handed over, so each thread is asked to
        send a token back. A second interruption ends the wait.
        """
        try:
            for worker in self._workers:
                token = _Token()
                worker.inbox.put(token)
                while worker.outbox.get() is not token:
                    pass
        except BaseException:
            self.lost = True
            for worker in self._workers:
                worker.inbox.put(None)
            self._workers = []
            raise


class EnvThreads:
    """Threads that each work for a fixed range of envs.

    An env stays with its thread: neighbours are close in memory, and OpenGL contexts may not change
    threads.

    Args:
        threads: How many threads, including the caller's.
        num_envs: How many envs there are.

    Attributes:
        parts: The numbers of each thread's envs, the caller's first.
    """

    def __init__(self, threads: int, num_envs: int) -> None:
        self._pool = ThreadPool(threads)
        ends = [num_envs * part // threads for part in range(threads + 1)]
        self.parts = [range(a, b) for a, b in pairwise(ends)]

    @property
    def lost(self) -> bool:
        """Return whether an interruption left threads running; do not touch their envs."""
        return self._pool.lost

    def do(
        self, work: Callable[[int], None], numbers: Iterable[int], *, alone: bool = False
    ) -> None:
        """Do `work` for some envs, each in its own thread; return when all of it is done.

        Args:
            work: Takes the number of an env.
            numbers: Numbers of the envs.
            alone: Whether the caller's thread does all of it.

        Raises:
            Exception: The exception of the first env that failed, with a note that names the env;
                the work is done for all others.
        """
        chosen = list(numbers)
        parts = [chosen] if alone else [[i for i in chosen if i in part] for part in self.parts]

        def work_through(part: Sequence[int], failures: Failures) -> None:
            for number in part:
                attempt(work, number, failures)

        self.share([partial(work_through, part) for part in parts])

    def share(self, jobs: Sequence[Callable[[Failures], None]]) -> None:
        """Run one job per thread, each of which appends what its envs raise to a list.

        Raises:
            Exception: As in `do`.
        """
        failures: Failures = []
        self._pool.run([partial(job, failures) for job in jobs])
        if failures:
            number, error = min(failures, key=lambda failure: failure[0])
            error.add_note(f"This was raised by env {number} of the vector env.")
            raise error

    def stop(self) -> None:
        """End the threads; the next work starts new ones."""
        self._pool.stop()


def attempt(work: Callable[[int], object], number: int, failures: Failures) -> None:
    """Do `work` for one env, and record what it raises.

    Args:
        work: Takes the number of an env.
        number: The number.
        failures: Receives the exception, which crosses to the caller's thread.
    """
    try:
        work(number)
    except Exception as error:
        failures.append((number, error))
