"""How a vehicle gets away from what it ran into: back, turning, and on."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from shapechanger.worlds.pathfinder.traits import Traits

__all__ = ["Recovery"]

PATIENCE_S: Final = 0.7
"""How long a vehicle that is driven may stand still before it counts as stuck."""

ASKED: Final = 0.25
"""Throttle from which a vehicle is being driven."""

STILL: Final = 0.05
"""Share of the top speed below which it stands still."""

TURNING: Final = 0.15
"""Rate of turn, rad/s, above which it does not stand still."""

BACK_S: Final = 1.0
BACK_AT_MOST_S: Final = 2.5
BACK_THROTTLE: Final = -0.6


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
        self.reset()

    def reset(self) -> None:
        """Begin anew."""
        self._still_s = 0.0
        self._back_s = 0.0
        self._tries = 0
        self._free_s = 0.0
        self._turn = 0.0

    @property
    def backing(self) -> bool:
        """Whether it drives the vehicle now."""
        return self._back_s > 0

    def watch(self, action: tuple[float, float], speed: float, yaw_rate: float) -> None:
        """Hear what was done, and what came of it.

        Args:
            action: Steering and throttle of now.
            speed: m/s.
            yaw_rate: rad/s.
        """
        asked = abs(action[1]) > ASKED
        if self._traits.drive == "tracks":
            asked = asked or abs(action[0]) > ASKED
        still = abs(speed) < STILL * self._traits.top_speed and abs(yaw_rate) < TURNING
        self._still_s = self._still_s + self._period_s if asked and still else 0.0
        self._free_s = 0.0 if still else self._free_s + self._period_s
        if self._free_s > 3.0 and not self.backing:
            self._tries = 0

    def action(self, angle: float) -> tuple[float, float] | None:
        """Steering and throttle that get it free; None while it needs no help.

        Args:
            angle: From its heading to where it wants to go, rad, counter-clockwise.
        """
        if self.backing:
            self._back_s -= self._period_s
            if not self.backing or self._still_s > PATIENCE_S:  # Done, or stuck behind as well.
                self._back_s = self._still_s = 0.0
                return None
            return self._turn, BACK_THROTTLE
        if self._still_s < PATIENCE_S:
            return None
        self._tries += 1
        longer = 1.4 ** (self._tries - 1) * self._rng.uniform(0.8, 1.2)
        self._back_s = min(BACK_S * longer, BACK_AT_MOST_S)
        self._still_s = 0.0
        self._turn = self._away(angle)
        return self._turn, BACK_THROTTLE

    def _away(self, angle: float) -> float:
        """The steering that turns its nose to where it wants to go while it backs up."""
        side: Literal[-1, 1] = 1 if angle >= 0 else -1
        if self._tries > 2 and self._rng.random() < 0.4:
            side = -1 if side == 1 else 1
        size = min(1.0, 0.4 + abs(angle))
        # Tracks turn the same way back and forth, wheels and rudders the other way.
        return (-0.5 if self._traits.drive == "tracks" else 1.0) * side * size
