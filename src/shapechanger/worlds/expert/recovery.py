"""Recovery of a stuck vehicle: back up, turn, and go on."""

from __future__ import annotations

from collections import deque
from typing import Final, Literal, NamedTuple

import numpy as np

from shapechanger.worlds.expert.traits import Traits

PATIENCE_S: Final = 0.7
"""Time after which a driven vehicle that stands still counts as stuck, s."""

SCRAPING_S: Final = 3.0
"""Time after which a slow vehicle counts as scraping along a wall, s."""

ASKED: Final = 0.25
"""Throttle or steering above which a vehicle counts as driven."""

STILL: Final = 0.05
"""Share of the top speed below which it stands still."""

SLOW: Final = 0.25
"""Share of the top speed below which it is slow."""

TURNING: Final = 0.15
"""Rate of turn, rad/s, above which it does not stand still."""

BACK_AT_MOST_S: Final = 4.0
BACK_THROTTLE: Final = -0.6


class _Move(NamedTuple):
    """One part of a recovery.

    Attributes:
        seconds: Duration.
        steering: Constant steering.
        throttle: Constant throttle.
    """

    seconds: float
    steering: float
    throttle: float


class Recovery:
    """Detects that a vehicle is stuck, and takes over until it is free.

    Args:
        traits: Driving properties of the vehicle.
        period_s: Control period, s.
        rng: Random generator that varies the manoeuvres, so that none repeats for ever.
    """

    def __init__(self, traits: Traits, period_s: float, rng: np.random.Generator) -> None:
        self._traits = traits
        self._period_s = period_s
        self._rng = rng
        self._moves: deque[_Move] = deque()
        self.reset()

    def reset(self) -> None:
        """Forget all timers and manoeuvres."""
        self._moves.clear()
        self._left_s = 0.0  # Remaining time of the first move.
        self._still_s = 0.0
        self._slow_s = 0.0
        self._free_s = 0.0
        self._tries = 0

    @property
    def active(self) -> bool:
        """Return whether a manoeuvre is being driven."""
        return bool(self._moves)

    def watch(
        self, action: tuple[float, float], speed: float, yaw_rate: float, *, blocked: bool
    ) -> None:
        """Update the timers from an action and its effect.

        Args:
            action: Steering and throttle.
            speed: Speed, m/s.
            yaw_rate: Rate of turn, rad/s.
            blocked: Whether an obstacle ahead prevents a necessary turn.
        """
        share = abs(speed) / self._traits.top_speed
        driven = abs(action[1]) > ASKED
        turned = self._traits.drive == "tracks" and abs(action[0]) > ASKED
        straight = abs(yaw_rate) < TURNING  # Turning on the spot is progress.
        still = share < STILL and straight
        # A boat with its bow at a quay turns until its stern touches as well, and then is stuck for
        # good; a car scrapes along. A tank turns away on the spot.
        still |= blocked and share < SLOW and action[1] > 0 and self._traits.drive != "tracks"
        self._still_s = self._still_s + self._period_s if still and (driven or turned) else 0.0
        self._slow_s = (
            self._slow_s + self._period_s if share < SLOW and straight and driven else 0.0
        )
        self._free_s = self._free_s + self._period_s if share >= SLOW else 0.0
        if self._free_s > SCRAPING_S and not self.active:
            self._tries = 0

    def action(self, angle: float) -> tuple[float, float] | None:
        """Steering and throttle of the manoeuvre; None if the vehicle is not stuck.

        Args:
            angle: Angle from the heading to the target, rad, counter-clockwise.
        """
        if self.active:
            self._left_s -= self._period_s
            if self._left_s <= 0 or self._still_s > PATIENCE_S:  # Finished, or stuck again.
                self._moves.popleft()
                self._begin_move()
        elif self._still_s > PATIENCE_S - self._period_s / 2:
            self._begin(angle, scraping=False)
        elif self._slow_s > SCRAPING_S:
            self._begin(angle, scraping=True)
        return self._moves[0][1:] if self.active else None

    def _begin(self, angle: float, *, scraping: bool) -> None:
        """Choose the moves of a manoeuvre."""
        self._tries += 1
        longer = 1.4 ** (self._tries - 1) * self._rng.uniform(0.8, 1.2)
        side: Literal[-1, 1] = 1 if angle >= 0 else -1
        if self._tries > 2 and self._rng.random() < 0.4:
            side = -1 if side == 1 else 1
        if self._traits.drive == "rudder" and scraping:
            # A rudder swings the stern, which a quay beside it prevents. Steering towards the quay
            # puts the bow there and frees the stern; then the boat backs away.
            self._moves.append(_Move(1.5 * longer, float(side), 0.5))
        seconds = (2.5 if self._traits.drive == "rudder" else 1.0) * longer
        # Going back, wheels and rudders turn the other way; tracks do not.
        turn = side * min(1.0, 0.4 + abs(angle))
        turn *= -0.5 if self._traits.drive == "tracks" else 1.0
        self._moves.append(_Move(min(seconds, BACK_AT_MOST_S), turn, BACK_THROTTLE))
        self._begin_move()

    def _begin_move(self) -> None:
        self._left_s = self._moves[0].seconds if self._moves else 0.0
        self._still_s = self._slow_s = 0.0
