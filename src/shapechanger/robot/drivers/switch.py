"""Bumper switches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Literal

from shapechanger.errors import UnknownName
from shapechanger.robot.drivers.edges import EdgeInput
from shapechanger.robot.drivers.settings import in_words, text, wholes
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware

_PULLS: Final = ("up", "down")


class Switch:
    """One or more switches; see `SensorDriver`. Pushes between two reads are not missed."""

    def __init__(
        self, pins: Sequence[int], pull: Literal["up", "down"], factory: Any, name: str
    ) -> None:
        self._name = name
        self._pressed_level = 0 if pull == "up" else 1
        self._was_pressed = False
        self._inputs = [EdgeInput(pin, pull, factory, self._changed) for pin in pins]

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return "bump", 1 if any switch is or was pressed since the last read, else 0."""
        # Cleared before the levels are read, so that a push in between counts.
        was_pressed, self._was_pressed = self._was_pressed, False
        with in_words(self._name):
            pressed = any(one.level == self._pressed_level for one in self._inputs)
        return {"bump": float(pressed or was_pressed)}

    def close(self) -> None:
        """Close the pins."""
        for one in self._inputs:
            one.close()

    def _changed(self, at_s: float, level: int) -> None:
        if level == self._pressed_level:
            self._was_pressed = True


def open_driver(plan: SensorPlan, hardware: Hardware) -> Switch:
    """Open the switches.

    The settings are the BCM `pins` and `pull`: "up" for switches to ground, "down" for switches to
    3.3 V.

    Raises:
        UnknownName: If there is no such pull.
    """
    pull = text(plan.settings, "pull")
    if pull not in _PULLS:
        raise UnknownName("pull", pull, _PULLS)
    name = f"Sensor {plan.name!r}"
    with in_words(name):
        return Switch(wholes(plan.settings, "pins"), pull, hardware.pin_factory(), name)
