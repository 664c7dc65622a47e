"""A fixed control rate, on a clock that is handed in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

__all__ = ["LATE", "Schedule"]

LATE: Final = 0.5
"""By how much of a period a step may end late without having missed its deadline."""


class Schedule:
    """Ticks of equal distance, in step with the robot.

    A step that ends a little late because this machine is slow is made up for by a shorter one, so
    that the mean rate holds. Where the robot's observation came after the tick, the ticks go on
    from there: two clocks are never equally fast, and the one who waits follows the other. A step
    that misses its deadline is not made up for either, because two commands in quick succession are
    worse than one that was late.

    Args:
        period_s: Time from tick to tick, s.
        clock: The time, s; never runs backwards.
    """

    def __init__(self, period_s: float, clock: Callable[[], float]) -> None:
        self._period_s = period_s
        self._clock = clock
        self._tick = clock()

    def start(self) -> None:
        """Let the first step begin now."""
        self._tick = self._clock()

    @property
    def left_s(self) -> float:
        """Time until the step should end, s; below zero when it is late."""
        return self._tick + self._period_s - self._clock()

    def advance(self, arrived_at: float) -> bool:
        """End a step and begin the next.

        Args:
            arrived_at: When the observation came that ends it, s.

        Returns:
            Whether it missed its deadline.
        """
        end = self._tick + self._period_s
        now = self._clock()
        missed = now - end > LATE * self._period_s
        self._tick = now if missed else max(end, arrived_at)
        return missed
