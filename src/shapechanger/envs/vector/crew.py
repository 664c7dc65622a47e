"""Doing something for every env, each thread for envs of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise

from shapechanger.envs.vector.pool import Pool

__all__ = ["Crew", "Failures", "work_through"]

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
