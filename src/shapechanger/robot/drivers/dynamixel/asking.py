"""Asks all servos in each cycle, and does not let one that is silent cost much time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapechanger.robot.drivers.dynamixel.registers import Register
from shapechanger.robot.drivers.dynamixel.wire import Answer, Wire

__all__ = ["Asking"]

# In so many cycles in a row the fast way may fail before it is given up.
_MOST_FAST_FAILURES: Final = 3


class Asking:
    """Who is asked, and how.

    In a sync read each servo waits for the one before it; so a silent one may silence those behind
    it. The first that is missing is suspected, and the others are asked once more without it. From
    then on it is asked alone, one suspect in each cycle: whatever is missing, a cycle waits twice
    at most, or three times while the fast way is tried.

    Args:
        wire: The bus.
        ids: Who is there.
        fast: Whether to try the fast sync read.

    Attributes:
        suspects: Who was missing when last asked.
        fast: Whether the fast way is still tried.
    """

    def __init__(self, wire: Wire, ids: Sequence[int], *, fast: bool) -> None:
        self._wire = wire
        self._ids = tuple(ids)
        self._fast_failures = 0
        self.suspects: list[int] = []
        self.fast = fast

    @property
    def trusted(self) -> tuple[int, ...]:
        """Who answered when last asked."""
        return tuple(one for one in self._ids if one not in self.suspects)

    def read(self, register: Register) -> dict[int, Answer]:
        """A register of everybody; who was not heard is not in it.

        Raises:
            RobotError: If the bus is gone.
        """
        asked = self.trusted
        heard = self._ask(register, asked)
        missing = [one for one in asked if one not in heard]
        if missing:
            first, *behind = missing
            self.suspects.append(first)
            heard |= self._wire.sync_read(register, behind) if behind else {}
            self.suspects += [one for one in behind if one not in heard][:1]
        elif self.suspects:
            suspect = self.suspects.pop(0)
            heard |= (answer := self._wire.sync_read(register, [suspect]))
            if not answer:
                self.suspects.append(suspect)
        return heard

    def _ask(self, register: Register, ids: Sequence[int]) -> dict[int, Answer]:
        if not ids:
            return {}
        if self.fast:
            if heard := self._wire.sync_read(register, ids, fast=True):
                self._fast_failures = 0
                return heard
            self._fast_failures += 1
            self.fast = self._fast_failures < _MOST_FAST_FAILURES
        return self._wire.sync_read(register, ids)
