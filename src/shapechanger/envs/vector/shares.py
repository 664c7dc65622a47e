"""Work that threads share: each does its own, and who is done helps the others."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Generic, TypeVar

__all__ = ["Shares"]

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
