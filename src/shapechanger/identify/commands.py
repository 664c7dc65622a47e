"""Commands as they act: held for a period, late, and followed with a lag."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from shapechanger.identify.log import FingerLog

__all__ = ["Commands"]


class Commands:
    """The commands of a log as functions of time.

    Args:
        log: What was commanded; before its first row the first command is taken to have acted.
    """

    def __init__(self, log: FingerLog) -> None:
        self._t = np.concatenate([[log.t[0] - 1.0], log.t])
        steps = np.diff(self._t)[:, None] * log.commands
        # Each command acts in the period that ends with its row.
        self._sums = np.concatenate(
            [np.zeros((1, log.commands.shape[1])), np.cumsum(steps, axis=0)]
        )

    def late(self, start: float, dt: float, steps: int, delay: float) -> NDArray[np.float64]:
        """What acts in each of some steps, (steps, 7): the mean over the step.

        Means make it a smooth function of the delay.

        Args:
            start: When the first step begins, s.
            dt: Length of a step, s.
            steps: How many.
            delay: How much later commands act, s.
        """
        edges = start + dt * np.arange(steps + 1) - delay
        sums = np.empty((steps + 1, self._sums.shape[1]))
        for i, column in enumerate(self._sums.T):
            sums[:, i] = np.interp(edges, self._t, column)
        return (sums[1:] - sums[:-1]) / dt

    def followed(
        self, start: float, dt: float, steps: int, delay: float, lag: float
    ) -> NDArray[np.float64]:
        """What motors have made of it at the end of each step, (steps, 7).

        Args:
            start: When the first step begins, s; the motors are at their command then.
            dt: Length of a step, s.
            steps: How many.
            delay: See `late`.
            lag: Time constant of the motors, s.
        """
        given = self.late(start, dt, steps, delay)
        keeps = np.exp(-dt / lag)
        start_at = keeps * given[:1]
        filtered = cast("Any", lfilter([1.0 - keeps], [1.0, -keeps], given, axis=0, zi=start_at))
        return np.asarray(filtered[0], np.float64)
