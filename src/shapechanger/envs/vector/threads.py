"""Threads that step the envs of a vector env; each has a fixed range of envs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from queue import SimpleQueue
from typing import Final

Failures = list[tuple[int, Exception]]
"""Exceptions, each with the number of the env that raised it."""

# A job of a worker, with the queue that receives its exception, or None.
_Answers = SimpleQueue[BaseException | None]
_Task = tuple[Callable[[], None], _Answers]

# Time limit for the end of a thread, s; it only has to finish a step.
_END_WITHIN_S: Final = 5.0


class _Worker(threading.Thread):
    """A thread that runs tasks until None arrives in its inbox."""

    def __init__(self) -> None:
        # A daemon thread, so that a program that does not close its envs can still exit.
        super().__init__(name="shapechanger-vector", daemon=True)
        self.inbox: SimpleQueue[_Task | None] = SimpleQueue()
        self.start()

    def run(self) -> None:
        while (task := self.inbox.get()) is not None:
            job, answers = task
            answer: BaseException | None = None
            try:
                job()
            except BaseException as error:  # Raised again in the caller's thread.
                answer = error
            del task, job  # A waiting thread must not keep the job's objects alive.
            answers.put(answer)
            del answer, answers


class EnvThreads:
    """Threads that each work for a fixed range of envs, the first of which is the caller's.

    An env stays with its thread: neighbours are close in memory, and OpenGL contexts may not change
    threads. The other threads start with the first work, and again in a forked process. A
    SimpleQueue stays consistent even when a signal interrupts the caller; a pair of locks does not.

    Args:
        threads: How many threads, including the caller's.
        num_envs: How many envs there are.

    Attributes:
        parts: The numbers of each thread's envs, the caller's first.
        lost: Whether an interruption left threads running; do not touch their envs.
    """

    def __init__(self, threads: int, num_envs: int) -> None:
        ends = [num_envs * part // threads for part in range(threads + 1)]
        self.parts = [range(a, b) for a, b in pairwise(ends)]
        self.lost = False
        self._workers: list[_Worker] = []

    def do(
        self, work: Callable[[int], object], numbers: Iterable[int], *, alone: bool = False
    ) -> None:
        """Do `work` for the envs of some numbers, each in its own thread; return at its end.

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
        """Run one job per thread, the first in the caller's, and return when all have ended.

        Each job appends what its envs raise to a list.

        Raises:
            Exception: As in `do`.
            BaseException: The exception of a job itself, such as KeyboardInterrupt.
        """
        failures: Failures = []
        first, *others = [partial(job, failures) for job in jobs]
        workers = self._awake() if others else []
        answers = _Answers()
        try:
            for worker, job in zip(workers, others, strict=True):
                worker.inbox.put((job, answers))
            first()
            errors = [answers.get() for _ in workers]
        except BaseException:
            # It is unknown which jobs were handed over, so wait until each thread has done an empty
            # job.
            settled = _Answers()
            try:
                for worker in workers:
                    worker.inbox.put((lambda: None, settled))
                for _ in workers:
                    settled.get()
            except BaseException:  # A second interruption ends the wait.
                self.lost = True
                raise
            raise
        for error in errors:
            if error is not None:
                raise error
        if failures:
            number, failure = min(failures, key=lambda failure: failure[0])
            failure.add_note(f"This was raised by env {number} of the vector env.")
            raise failure

    def stop(self) -> None:
        """End the threads; the next work starts new ones."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.inbox.put(None)
        for worker in workers:
            if worker is not threading.current_thread():
                worker.join(_END_WITHIN_S)

    def _awake(self) -> list[_Worker]:
        """Return the threads, started if they are not alive."""
        if not all(worker.is_alive() for worker in self._workers):
            self._workers = []  # pragma: no cover  # After a fork; tested in a subprocess.
        while len(self._workers) < len(self.parts) - 1:
            self._workers.append(_Worker())
        return self._workers


def attempt(work: Callable[[int], object], number: int, failures: Failures) -> None:
    """Do `work` for one env, and record its exception, which the caller's thread raises."""
    try:
        work(number)
    except Exception as error:
        failures.append((number, error))
