"""A mailbox with one slot: what is newer replaces what was not read in time."""

from __future__ import annotations

from typing import Generic, TypeVar

__all__ = ["Latest"]

_T = TypeVar("_T")


class Latest(Generic[_T]):
    """Holds the newest thing that was put, until it is taken once.

    A queue plays back what piled up while nobody read; this cannot, since it holds one thing and
    gives it away once. One thread may put and another may take; a race can only lose a thing to a
    newer one.
    """

    __slots__ = ("_slot",)

    def __init__(self) -> None:
        self._slot: list[_T] = []

    def __bool__(self) -> bool:
        """Whether there is something to take."""
        return bool(self._slot)

    def put(self, thing: _T) -> None:
        """Replace what is there."""
        self._slot = [thing]

    def take(self) -> _T | None:
        """The newest thing, which is then gone; None if there is none."""
        slot = self._slot
        try:
            return slot.pop()  # Whoever pops first has it; `put` makes a new list.
        except IndexError:
            return None

    def clear(self) -> None:
        """Throw away what is there."""
        self._slot = []
