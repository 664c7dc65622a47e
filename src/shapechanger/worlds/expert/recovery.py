"""How a vehicle gets away from what it ran into: back, turning, and on."""

from __future__ import annotations

from collections import deque
from typing import Final, Literal, NamedTuple

import numpy as np

from shapechanger.worlds.expert.traits import Traits

__all__ = ["Recovery"]

PATIENCE_S: Final = 0.7
"""How long a vehicle that is driven may stand still before it counts as stuck."""

SCRAPING_S: Final = 3.0
"""How long it may be slow, as a vehicle that drags along a wall is."""

ASKED: Final = 0.25
"""Throttle from which a vehicle is being driven."""

STILL: Final = 0.05
"""Share of the top speed below which it stands still."""

SLOW: Final = 0.25
"""Share of the top speed below which it is slow."""

TURNING: Final = 0.15
"""Rate of turn, rad/s, above which it does not stand still."""

BACK_AT_MOST_S: Final = 4.0
BACK_THROTTLE: Final = -0.6


class _Move(NamedTuple):
    """One part of getting away.

    Attributes:
        seconds: How long.
        steering: Of all that time.
        throttle: Of all that time.
    """

    seconds: float
    steering: float
    throttle: float


class Recovery:
    """Watches whether a vehicle gets on, and takes over where it does not.

    Args:
        traits: How it is driven.
        period_s: Time from one action to the next, s.
        rng: Makes no two tries alike, so that none is repeated for ever.
    """

    def __init__(self, traits: Traits, period_s: float, rng: np.random.Generator) -> None:
        self._traits = traits
        self._period_s = period_s
        self._rng = rng
        self._moves: deque[_Move] = deque()
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self._moves.clear()
        self._left_s = 0.0  # Of the first move.
        self._still_s = 0.0
        self._slow_s = 0.0
        self._free_s = 0.0
        self._tries = 0

    @property
    def active(self) -> bool:
        """Whether it drives the vehicle now."""
        return bool(self._moves)

    def watch(
        self, action: tuple[float, float], speed: float, yaw_rate: float, *, blocked: bool
    ) -> None:
        """Hear what was done, and what came of it.

        Args:
            action: Steering and throttle of now.
            speed: m/s.
            yaw_rate: rad/s.
            blocked: Whether something is right before its nose that it wants to turn away from.
        """
        share = abs(speed) / self._traits.top_speed
        driven = abs(action[1]) > ASKED
        turned = self._traits.drive == "tracks" and abs(action[0]) > ASKED
        straight = abs(yaw_rate) < TURNING  # Who turns on the spot gets on, too.
        still = share < STILL and straight
        # With its bow at a quay a boat turns until its stern is there as well, and then is stuck
        # for good; and a car scrapes along. Tracks turn it away where it stands.
        still |= blocked and share < SLOW and action[1] > 0 and self._traits.drive != "tracks"
        self._still_s = self._still_s + self._period_s if still and (driven or turned) else 0.0
        self._slow_s = (
            self._slow_s + self._period_s if share < SLOW and straight and driven else 0.0
        )
        self._free_s = self._free_s + self._period_s if share >= SLOW else 0.0
        if self._free_s > SCRAPING_S and not self.active:
            self._tries = 0

    def action(self, angle: float) -> tuple[float, float] | None:
        """Steering and throttle that get it free; None while it needs no help.

        Args:
            angle: From its heading to where it wants to go, rad, counter-clockwise.
        """
        if self.active:
            self._left_s -= self._period_s
            if self._left_s <= 0 or self._still_s > PATIENCE_S:  # Done, or stuck here as well.
                self._moves.popleft()
                self._begin_move()
        elif self._still_s > PATIENCE_S - self._period_s / 2:
            self._begin(angle, scraping=False)
        elif self._slow_s > SCRAPING_S:
            self._begin(angle, scraping=True)
        return self._moves[0][1:] if self.active else None

    def _begin(self, angle: float, *, scraping: bool) -> None:
        """Decide on moves."""
        self._tries += 1
        longer = 1.4 ** (self._tries - 1) * self._rng.uniform(0.8, 1.2)
        side: Literal[-1, 1] = 1 if angle >= 0 else -1
        if self._tries > 2 and self._rng.random() < 0.4:
            side = -1 if side == 1 else 1
        if self._traits.drive == "rudder" and scraping:
            # A rudder swings the stern, and a stern at a quay cannot swing: it is the other way
            # round that gets it off, with the bow at the quay, and then the boat backs away.
            self._moves.append(_Move(1.5 * longer, float(side), 0.5))
        seconds = (2.5 if self._traits.drive == "rudder" else 1.0) * longer
        # Tracks turn the same way back and forth, wheels and rudders the other way.
        turn = side * min(1.0, 0.4 + abs(angle))
        turn *= -0.5 if self._traits.drive == "tracks" else 1.0
        self._moves.append(_Move(min(seconds, BACK_AT_MOST_S), turn, BACK_THROTTLE))
        self._begin_move()

    def _begin_move(self) -> None:
        self._left_s = self._moves[0].seconds if self._moves else 0.0
        self._still_s = self._slow_s = 0.0
