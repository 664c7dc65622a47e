"""Digital inputs with interrupts and timestamps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal


class EdgeInput:
    """Input with a callback on each change of its level.

    Args:
        pin: BCM number.
        pull: Direction of the internal pull resistor.
        factory: Pin factory of gpiozero.
        changed: Receives the time, s, on its own clock, and the new level. lgpio calls it from
            its own thread.
    """

    def __init__(
        self,
        pin: int,
        pull: Literal["up", "down"],
        factory: Any,
        changed: Callable[[float, int], None],
    ) -> None:
        from gpiozero import InputDevice  # A twin's worlds need no gpiozero.

        self._active = 0 if pull == "up" else 1
        self._changed = changed
        self._device = InputDevice(pin, pull_up=pull == "up", pin_factory=factory)
        # gpiozero's devices do not pass the timestamp on; their pins do.
        self._device.pin.edges = "both"
        self._device.pin.when_changed = self._call

    @property
    def level(self) -> int:
        """Current level, 0 or 1."""
        return self._active if self._device.is_active else 1 - self._active

    def close(self) -> None:
        """Close the pin."""
        if not self._device.closed:
            self._device.pin.when_changed = None
            self._device.close()

    def _call(self, at_s: float, level: int) -> None:
        if level in (0, 1):  # lgpio reports 2 for a watchdog timeout.
            self._changed(at_s, int(level))
