"""Doing something for every env, each thread for envs of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
    """

    def __init__(self, threads: int) -> None:
        self._pool = Pool(threads)

    @property
    def threads(self) -> int:
        """How many threads there are, with that of the caller."""
        return self._pool.threads

    @property
    def lost(self) -> bool:
        """Whether an interruption left threads at work; their envs are not to be touched."""
        return self._pool.lost

    def do(self, work: _Work, numbers: Sequence[int], *, alone: bool = False) -> None:
        """Do `work` for the envs `numbers`, and return when all of it is done.

        Args:
            work: What to do for the env of a number.
            numbers: Numbers of the envs.
            alone: Whether the caller's thread does it all.

        Raises:
            Exception: What the work raised for the first env that failed, with the env's number as
                a note; it was done for all others.
        """
        self.share(partial(work_through, work), numbers, alone=alone)

    def share(
        self,
        work: Callable[[Sequence[int], Failures], None],
        numbers: Sequence[int],
        *,
        alone: bool = False,
    ) -> None:
        """Let each thread do `work` for its part of the envs `numbers`.

        Args:
            work: What to do for the envs of these numbers; appends what an env raises.
            numbers: Numbers of the envs.
            alone: Whether the caller's thread does it all.

        Raises:
            Exception: As in `do`.
        """
        failures: Failures = []
        parts = 1 if alone else min(self._pool.threads, len(numbers))
        ends = [len(numbers) * part // parts for part in range(parts + 1)]
        self._pool.run([partial(work, numbers[a:b], failures) for a, b in pairwise(ends)])
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
