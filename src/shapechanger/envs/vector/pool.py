"""Threads that wait for work, with one hand-over per thread."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Final

__all__ = ["Pool"]

_Job = Callable[[], None]

# How long the end of a thread is waited for, s; it only has to finish a step.
_END_WITHIN_S: Final = 5.0


class _Token:
    """Comes back from a thread that has done all that it was given before."""


class _Worker:
    """One thread, what it is given, and what it answers: None, the token, or what was raised."""

    def __init__(self) -> None:
        self.inbox: SimpleQueue[_Job | _Token | None] = SimpleQueue()
        self.outbox: SimpleQueue[BaseException | _Token | None] = SimpleQueue()
        # A daemon: a program that forgets to close its envs must end nevertheless.
        self.thread = threading.Thread(
            target=_serve, args=(self.inbox, self.outbox), name="shapechanger-vector", daemon=True
        )
        self.thread.start()


def _serve(
    inbox: SimpleQueue[_Job | _Token | None], outbox: SimpleQueue[BaseException | _Token | None]
) -> None:
    """Do what comes, until None comes."""
    while (job := inbox.get()) is not None:
        answer: BaseException | _Token | None = None
        if isinstance(job, _Token):
            answer = job
        else:
            try:
                job()
            except BaseException as error:  # It crosses to the caller, who raises it.
                answer = error
        del job  # Waiting must not keep alive what the job knows.
        outbox.put(answer)
        del answer


class Pool:
    """Runs a few jobs at a time: the first in the caller's thread, the others in their own.

    Threads start with the first work, and again in a process that was forked. A SimpleQueue takes
    an item in one piece even when a signal interrupts the caller; a pair of locks does not.

    Args:
        threads: How many, with that of the caller.

    Attributes:
        lost: Whether an interruption left threads at work; what they work on is not to be touched.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.lost = False
        self._workers: list[_Worker] = []

    def run(self, jobs: Sequence[_Job]) -> None:
        """Run at most as many jobs as there are threads; return, or raise, when all have ended.

        Raises:
            BaseException: What the first of the jobs that failed has raised.
        """
        if len(jobs) == 1:
            jobs[0]()
            return
        workers = self._awake()
        failures: list[BaseException] = []
        try:
            for worker, job in zip(workers, jobs[1:], strict=False):
                worker.inbox.put(job)
            jobs[0]()
            for worker in workers[: len(jobs) - 1]:
                answer = worker.outbox.get()
                if isinstance(answer, BaseException):
                    failures.append(answer)
        except BaseException:
            self._settle()
            raise
        if failures:
            raise failures[0]

    def stop(self) -> None:
        """End the threads; the next work starts others."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.inbox.put(None)
        for worker in workers:
            if worker.thread is not threading.current_thread():
                worker.thread.join(_END_WITHIN_S)

    def _awake(self) -> list[_Worker]:
        """The threads, started if they are not there."""
        if not all(worker.thread.is_alive() for worker in self._workers):
            self._workers = []
        while len(self._workers) < self.threads - 1:
            self._workers.append(_Worker())
        return self._workers

    def _settle(self) -> None:
        """Wait until all threads have ended what they were given, whatever that was.

        An interruption does not say which hand-overs it came between, so each thread is asked to
        send something back. Whoever interrupts this too does not want to wait.
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
