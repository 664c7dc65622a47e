"""Threads that step the envs of a vector env; each has its own range of envs."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise
from queue import SimpleQueue
from typing import Final

# A job of a worker, and the queue that receives None when the job has ended.
_Task = tuple[Callable[[], None], SimpleQueue[None]]

# Longest wait for the end of a thread, s; a thread only has to finish a step.
_END_WITHIN_S: Final = 5.0


class _Worker(threading.Thread):
    """A thread that runs tasks, which do not raise, until None arrives in its inbox."""

    def __init__(self) -> None:
        # A daemon thread, so that a program that does not close its envs can still exit.
        super().__init__(name="shapechanger-vector", daemon=True)
        self.inbox: SimpleQueue[_Task | None] = SimpleQueue()
        self.start()

    def run(self) -> None:
        while (task := self.inbox.get()) is not None:
            job, done = task
            job()
            del task, job  # A waiting thread must not keep the job's objects alive.
            done.put(None)


class EnvThreads:
    """Threads that each work for their own range of envs; the caller's thread has the first range.

    Work stays with an env's thread unless `do` permits others: neighbours are close in memory, and
    OpenGL contexts may not change threads. Threads start with the first work, also of a fork. A
    SimpleQueue stays consistent even when a signal interrupts the caller; a pair of locks does not.

    Attributes:
        lost: Whether an interruption left threads running; do not touch their envs.
    """

    def __init__(self, threads: int, num_envs: int) -> None:
        ends = [num_envs * part // threads for part in range(threads + 1)]
        self._parts = [range(a, b) for a, b in pairwise(ends)]
        self.lost = False
        self._workers: list[_Worker] = []

    def do(
        self,
        work: Callable[[int], object],
        numbers: Iterable[int],
        *,
        anywhere: Iterable[int] = (),
        alone: bool = False,
    ) -> None:
        """Do `work` for some envs, and return when it has ended for all of them.

        Each env in `numbers` is done by its own thread, and each env in `anywhere` by the first
        free thread; with `alone`, the caller's thread does all. If envs fail, the exception of the
        one with the lowest number is raised after all other work, with a note that names the env.
        """
        chosen, queue = list(numbers), deque(anywhere)
        parts = [chosen] if alone else [[i for i in chosen if i in part] for part in self._parts]
        failures: list[tuple[int, BaseException]] = []

        def attempt(number: int) -> None:
            try:
                work(number)
            except BaseException as error:  # Raised again below, in the caller's thread.
                failures.append((number, error))

        def work_through(thread: int) -> None:
            for number in parts[thread]:
                attempt(number)
            # Threads rarely take equally long, so they share a queue and pop envs from both ends.
            take = queue.pop if thread % 2 else queue.popleft
            while True:
                try:
                    number = take()
                except IndexError:  # All envs have been taken.
                    return
                attempt(number)

        workers = [] if alone else self._awake()
        done: SimpleQueue[None] = SimpleQueue()
        try:
            for thread, worker in enumerate(workers, 1):
                worker.inbox.put((partial(work_through, thread), done))
            work_through(0)
            for _ in workers:
                done.get()
        except BaseException:  # It is unknown which jobs the threads have received.
            self._settle(workers)
            raise
        if failures:
            number, failure = min(failures, key=lambda failure: failure[0])
            failure.add_note(f"This was raised by env {number} of the vector env.")
            raise failure

    def _settle(self, workers: list[_Worker]) -> None:
        """Wait until each thread has done an empty job; a second interruption ends the wait."""
        settled: SimpleQueue[None] = SimpleQueue()
        try:
            for worker in workers:
                worker.inbox.put((lambda: None, settled))
            for _ in workers:
                settled.get()
        except BaseException:
            self.lost = True
            raise

    def stop(self) -> None:
        """End the threads; the next work starts new ones."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.inbox.put(None)
        for worker in workers:
            if worker is not threading.current_thread():
                worker.join(_END_WITHIN_S)

    def _awake(self) -> list[_Worker]:
        """Return the threads, and start them if they are not alive."""
        if not all(worker.is_alive() for worker in self._workers):
            self._workers = []  # After a fork.
        while len(self._workers) < len(self._parts) - 1:
            self._workers.append(_Worker())
        return self._workers
