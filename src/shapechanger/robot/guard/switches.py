"""The two pins of the guard itself: the enable line's one-shot, and the emergency button."""

from __future__ import annotations

from typing import Any

from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.hardware import Hardware

__all__ = ["Switches", "enable_device"]


def enable_device(pin: int, hardware: Hardware) -> Any:
    """The pin that triggers the one-shot, low."""
    from gpiozero import OutputDevice  # Not for a robot without such pins.

    return OutputDevice(pin, initial_value=False, pin_factory=hardware.pin_factory())


class Switches:
    """Toggles the enable pin, and reads the button.

    The enable pin feeds a one-shot that holds the enable line of the motors for some ticks after
    each edge. Whatever ends the edges, also a guard that is gone together with its supervisor, cuts
    the motors.

    Args:
        plan: The robot.
        hardware: Where the pins are.
    """

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
        self._enable: Any = None
        self._button: Any = None
        if plan.stop_pin is not None:
            from gpiozero import InputDevice

            # To ground when pressed; a button whose wire is cut is not noticed.
            factory = hardware.pin_factory()
            self._button = InputDevice(plan.stop_pin, pull_up=True, pin_factory=factory)
        if plan.enable_pin is not None:
            self._enable = enable_device(plan.enable_pin, hardware)

    @property
    def pressed(self) -> bool:
        """Whether the emergency button is pressed."""
        return self._button is not None and bool(self._button.is_active)

    def toggle(self) -> None:
        """Trigger the one-shot."""
        if self._enable is not None:
            self._enable.toggle()

    def close(self) -> None:
        """Enable nothing any more, and let go of the pins."""
        if self._enable is not None:
            self._enable.off()
        for device in (self._enable, self._button):
            if device is not None:
                device.close()
