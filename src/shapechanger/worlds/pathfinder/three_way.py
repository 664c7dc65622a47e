"""Steering for a vehicle that knows only left, straight on and right, as that of 2017 did."""

from __future__ import annotations

__all__ = ["ThreeWay"]


class ThreeWay:
    """Gives each side its share of time.

    What a step steers too much or too little is made up for by the next ones, as in a sigma-delta
    modulator of first order (H. Inose, Y. Yasuda, "A unity bit coding method by negative
    feedback", Proceedings of the IEEE 51, 1963).
    """

    def __init__(self) -> None:
        self._owed = 0.0

    def reset(self) -> None:
        """Owe nothing."""
        self._owed = 0.0

    def step(self, steering: float) -> float:
        """-1, 0 or 1, whose mean over some steps is the steering that was asked for."""
        self._owed += steering
        given = float(max(-1, min(1, round(self._owed))))
        self._owed = max(-1.0, min(1.0, self._owed - given))
        return given
