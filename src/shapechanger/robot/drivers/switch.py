"""Bumper switches."""

from __future__ import annotations

from shapechanger.robot.drivers.edges import EdgeInput
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware


class Switch:
    """One or more switches; see `SensorDriver`. Pushes between two reads are not missed.

    The settings are the BCM `pins` and `pull`: "up" for switches to ground, "down" for switches to
    3.3 V.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        pull = plan.settings["pull"]
        self._name = f"Sensor {plan.name!r}"
        self._pressed_level = 0 if pull == "up" else 1
        self._was_pressed = False
        with device_errors(self._name):
            factory = hardware.pin_factory()
            self._inputs = [
                EdgeInput(pin, pull, factory, self._changed) for pin in plan.settings["pins"]
            ]

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return "bump", 1 if any switch is or was pressed since the last read, else 0."""
        # Cleared before the levels are read, so that a push in between counts.
        was_pressed, self._was_pressed = self._was_pressed, False
        with device_errors(self._name):
            pressed = any(one.level == self._pressed_level for one in self._inputs)
        return {"bump": float(pressed or was_pressed)}

    def close(self) -> None:
        """Close the pins."""
        for one in self._inputs:
            one.close()

    def _changed(self, at_s: float, level: int) -> None:
        if level == self._pressed_level:
            self._was_pressed = True
