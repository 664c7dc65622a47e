"""Motion as a sum of oscillations, of which all derivatives are known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shapechanger.tasks.paths.asked import Vector
from shapechanger.tasks.paths.path import Points, Times

__all__ = ["Harmonics"]


@dataclass(frozen=True, slots=True)
class Harmonics:
    """A Fourier series.

    At the angle a = 2π `hz` t + `phase` the point is at
    `centre` + Σ (cos(k a) `cosines[k - 1]` + sin(k a) `sines[k - 1]`), with k = 1, 2, …

    Attributes:
        hz: Rounds in a second, above 0.
        phase: Where on the round it begins, rad.
        centre: The middle over time, m.
        cosines: What goes with the cosine of each multiple of the angle, m.
        sines: What goes with its sine, m; as many.
    """

    hz: float
    phase: float
    centre: Vector
    cosines: tuple[Vector, ...]
    sines: tuple[Vector, ...]

    def derivative(self, t: Times, order: int) -> Points:
        """Position, velocity or acceleration, as `Motion` says, at times of any size and sign."""
        multiples = np.arange(1.0, len(self.cosines) + 1.0)
        rates = math.tau * self.hz * multiples  # rad/s, shape (k,).
        # Each derivative of a sine or cosine is a quarter of a turn ahead, and grows by the rate.
        angles = rates * t[:, None] + self.phase * multiples + order * math.pi / 2.0
        grown = rates**order
        points = (grown * np.cos(angles)) @ np.array(self.cosines)
        points += (grown * np.sin(angles)) @ np.array(self.sines)
        if order == 0:
            points += self.centre
        return points
