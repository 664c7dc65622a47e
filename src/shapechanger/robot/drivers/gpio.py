"""Inputs whose changes are noticed by interrupt, with the time of each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal

from gpiozero import InputDevice

__all__ = ["Duty", "EdgeInput"]


class EdgeInput:
    """An input that calls back at each change of its level.

    Args:
        pin: Its BCM number.
        pull: Which way the resistor in the Pi pulls it.
        factory: Where gpiozero takes the pin from.
        changed: Gets the time in seconds, on a clock of its own, and the new level. lgpio calls it
            from a thread of its own.
    """

    def __init__(
        self,
        pin: int,
        pull: Literal["up", "down"],
        factory: Any,
        changed: Callable[[float, int], None],
    ) -> None:
        self._active = 0 if pull == "up" else 1
        self._changed = changed
        self._device = InputDevice(pin, pull_up=pull == "up", pin_factory=factory)
        # The devices of gpiozero that call back keep the time to themselves; their pins tell it.
        self._device.pin.edges = "both"
        self._device.pin.when_changed = self._call

    @property
    def level(self) -> int:
        """0 or 1 as it is now."""
        return self._active if self._device.is_active else 1 - self._active

    def close(self) -> None:
        """Let go of the pin."""
        if not self._device.closed:
            self._device.pin.when_changed = None
            self._device.close()

    def _call(self, at_s: float, level: int) -> None:
        if level in (0, 1):  # lgpio has a 2 for "nothing came for a while".
            self._changed(at_s, int(level))


# gpiozero over lgpio has steps of 1 % (`LGPIOPin._set_state`: `int(value * 100)`). We round to them
# ourselves, so that every pin factory does the same, and what we answer is what is done.
_STEPS: Final = 100


@dataclass(frozen=True, slots=True)
class Duty:
    """A range of duty cycles.

    Attributes:
        start: Smallest duty that moves the motor, 0 to 1; the smallest values are mapped there.
        full: Duty at a value of 1, at most 1.
    """

    start: float = 0.0
    full: float = 1.0

    def of(self, value: float) -> float:
        """The duty for the size of a value, in whole steps."""
        size = min(abs(value), 1.0)
        if size == 0.0:
            return 0.0
        return _step(round((self.start + (self.full - self.start) * size) * _STEPS))

    def size_at(self, duty: float) -> float:
        """The size of the value that a duty stands for; more than 0 for every duty above 0."""
        if duty <= 0.0:
            return 0.0
        if self.full <= self.start:
            return 1.0
        # A duty that was rounded to just below `start` still turns the motor.
        return min(max((duty - self.start) / (self.full - self.start), 0.5 / _STEPS), 1.0)


def _step(steps: int) -> float:
    """A duty that `int(duty * 100)` turns into these steps: 0.29 * 100 is 28.999999999999996."""
    duty = steps / _STEPS
    return duty if int(duty * _STEPS) == steps else math.nextafter(duty, 1.0)
