"""The place before the door: sockets of which nobody knows yet who holds their other end."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Final, Protocol

__all__ = ["PATIENCE_S", "Doorstep", "Visitor"]

PATIENCE_S: Final = 3.0
"""Seconds in which a socket must ask for something, and after that for the next thing."""

_MOST: Final = 48
_MOST_OF_ONE: Final = 16  # A browser opens six, and somebody may have two pages open.


class Visitor(Protocol):
    """A socket that was accepted."""

    @property
    def address(self) -> str:
        """Where it comes from."""
        ...

    @property
    def is_gone(self) -> bool:
        """Whether it has closed by itself."""
        ...

    def drop(self) -> None:
        """End it, without a word."""
        ...


@dataclass(frozen=True, slots=True)
class _Waiting:
    visitor: Visitor
    timer: asyncio.TimerHandle


class Doorstep:
    """Keeps strangers few and short, so that whoever holds the key always finds a place.

    Nobody is turned away for others' sake, since that one may be the person who wants to stop the
    robot: the newcomer gets the place of the oldest socket of the address that has the most.

    Args:
        most: How many may be here.
        most_of_one: How many of one address.
        patience_s: Seconds after which one that asked for nothing is dropped.
    """

    def __init__(
        self, most: int = _MOST, most_of_one: int = _MOST_OF_ONE, patience_s: float = PATIENCE_S
    ) -> None:
        self._most = most
        self._most_of_one = most_of_one
        self._patience_s = patience_s
        self._waiting: dict[Hashable, _Waiting] = {}

    def __len__(self) -> int:
        """How many are here."""
        return len(self._waiting)

    def enter(self, key: Hashable, visitor: Visitor) -> None:
        """Let a socket wait; there is always room, at somebody's cost.

        Args:
            key: What it is known by from now on.
            visitor: The socket.
        """
        for other in [k for k, waiting in self._waiting.items() if waiting.visitor.is_gone]:
            self.leave(other)
        counts = Counter(waiting.visitor.address for waiting in self._waiting.values())
        if counts[visitor.address] >= self._most_of_one:
            self._drop_oldest(visitor.address)
        elif len(self._waiting) >= self._most:
            self.drop_one()
        timer = asyncio.get_running_loop().call_later(self._patience_s, self._drop, key)
        self._waiting[key] = _Waiting(visitor, timer)

    def renew(self, key: Hashable) -> None:
        """It was given a file of the console: it may wait anew, as the youngest."""
        waiting = self._waiting.pop(key, None)
        if waiting is None:
            return
        waiting.timer.cancel()
        timer = asyncio.get_running_loop().call_later(self._patience_s, self._drop, key)
        self._waiting[key] = _Waiting(waiting.visitor, timer)

    def keep(self, key: Hashable) -> None:
        """It asked for the link, which has a limit of its own for the hello."""
        if key in self._waiting:
            self._waiting[key].timer.cancel()

    def leave(self, key: Hashable) -> None:
        """It has shown the key, or it has ended."""
        waiting = self._waiting.pop(key, None)
        if waiting is not None:
            waiting.timer.cancel()

    def drop_one(self) -> None:
        """Make room: the oldest one of the address that has the most."""
        counts = Counter(waiting.visitor.address for waiting in self._waiting.values())
        if counts:
            # Of addresses that have as many, the first is the one that has been here longest.
            self._drop_oldest(max(counts, key=lambda address: counts[address]))

    def close(self) -> None:
        """Drop everybody."""
        for key in list(self._waiting):
            self._drop(key)

    def _drop_oldest(self, address: str) -> None:
        self._drop(next(k for k, w in self._waiting.items() if w.visitor.address == address))

    def _drop(self, key: Hashable) -> None:
        visitor = self._waiting[key].visitor
        self.leave(key)
        visitor.drop()
