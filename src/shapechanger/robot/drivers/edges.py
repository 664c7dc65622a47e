"""Inputs whose changes are noticed by interrupt, with the time of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from gpiozero import InputDevice

__all__ = ["EdgeInput"]


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
