"""Duty cycles: conversion between an output value and the share of time that it is on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

# gpiozero over lgpio has steps of 1 % (`LGPIOPin._set_state`: `int(value * 100)`). Rounding to them
# here makes all pin factories equal, and the returned value is the applied one.
_STEPS: Final = 100


@dataclass(frozen=True, slots=True)
class Duty:
    """Range of duty cycles.

    Attributes:
        start: Smallest duty that moves the motor, 0 to 1; the smallest values are mapped there.
        full: Duty at a value of 1, at most 1.
    """

    start: float = 0.0
    full: float = 1.0

    def of(self, value: float) -> float:
        """Return the duty cycle for the magnitude of a value, in whole steps."""
        size = min(abs(value), 1.0)
        if size == 0.0:
            return 0.0
        return _step(round((self.start + (self.full - self.start) * size) * _STEPS))

    def size_at(self, duty: float) -> float:
        """Return the magnitude of the value of a duty cycle; above 0 for every duty above 0."""
        if duty <= 0.0:
            return 0.0
        if self.full <= self.start:
            return 1.0
        # A duty that was rounded to just below `start` still turns the motor.
        return min(max((duty - self.start) / (self.full - self.start), 0.5 / _STEPS), 1.0)


def _step(steps: int) -> float:
    """Return a duty for which `int(duty * 100)` is `steps`: 0.29 * 100 is 28.999999999999996."""
    duty = steps / _STEPS
    return duty if int(duty * _STEPS) == steps else math.nextafter(duty, 1.0)
