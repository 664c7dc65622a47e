"""Threads that wait for work, with one hand-over per thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from queue import SimpleQueue
from typing import Final, Generic, TypeVar

__all__ = ["Crew", "Failures", "Pool", "Shares", "work_through"]

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


# What was raised, with the number of the env.
Failures = list[tuple[int, Exception]]

_Work = Callable[[int], None]


class Crew:
    """Threads that share envs among themselves, always in the same way.

    An env stays with its thread: neighbours are near in memory, and what draws with OpenGL may not
    change threads.

    Args:
        threads: How many, with that of the caller.
        num_envs: How many envs there are.

    Attributes:
        parts: The numbers of the envs of each thread, that of the caller first.
    """

    def __init__(self, threads: int, num_envs: int) -> None:
        self._pool = Pool(threads)
        ends = [num_envs * part // threads for part in range(threads + 1)]
        self.parts = [range(a, b) for a, b in pairwise(ends)]

    @property
    def threads(self) -> int:
        """How many threads there are, with that of the caller."""
        return self._pool.threads

    @property
    def lost(self) -> bool:
        """Whether an interruption left threads at work; their envs are not to be touched."""
        return self._pool.lost

    def do(self, work: _Work, numbers: Iterable[int], *, alone: bool = False) -> None:
        """Do `work` for the envs `numbers`, each in its thread; return when all of it is done.

        Args:
            work: What to do for the env of a number.
            numbers: Numbers of the envs.
            alone: Whether the caller's thread does it all.

        Raises:
            Exception: What the work raised for the first env that failed, with the env's number as
                a note; it was done for all others.
        """
        chosen = list(numbers)
        parts = [chosen] if alone else [[i for i in chosen if i in part] for part in self.parts]
        self.share([partial(work_through, work, part) for part in parts])

    def share(self, works: Sequence[Callable[[Failures], None]]) -> None:
        """Let each thread do one of `works`, which appends what an env raises.

        Raises:
            Exception: As in `do`.
        """
        failures: Failures = []
        self._pool.run([partial(work, failures) for work in works])
        if failures:
            number, error = min(failures, key=lambda failure: failure[0])
            error.add_note(f"This was raised by env {number} of the vector env.")
            raise error

    def stop(self) -> None:
        """End the threads; the next work starts others."""
        self._pool.stop()


def work_through(work: _Work, numbers: Sequence[int], failures: Failures) -> None:
    """Do something for some envs; one that raises does not stop the others."""
    for number in numbers:
        try:
            work(number)
        except Exception as error:  # It crosses to the caller, who raises it.
            failures.append((number, error))


Item = TypeVar("Item")


class Shares(Generic[Item]):
    """Items of work, each of which one thread takes.

    Threads rarely take equally long: envs differ, and a core may be busy with something else. Each
    thread takes its own items from the front, and then those of others from the back, so that
    neighbours stay together as long as they can.

    Args:
        threads: How many threads there are.
    """

    def __init__(self, threads: int) -> None:
        # A deque gives each item once.
        self._parts: list[deque[Item]] = [deque() for _ in range(threads)]

    def own(self, thread: int, items: Iterable[Item]) -> Iterator[Item]:
        """What one thread takes of its own items.

        Args:
            thread: The number of the thread, from 0.
            items: Its items, which others may take from now on.
        """
        if len(self._parts) == 1:
            return iter(items)
        mine = self._parts[thread]
        mine.extend(items)
        return _taken(mine, mine.popleft)

    def others(self, thread: int) -> Iterator[Item]:
        """What it then takes of theirs."""
        for part in self._parts:
            if part is not self._parts[thread]:
                yield from _taken(part, part.pop)


def _taken(part: deque[Item], take: Callable[[], Item]) -> Iterator[Item]:
    while part:
        try:
            item = take()
        except IndexError:  # Another was quicker.
            break
        yield item
