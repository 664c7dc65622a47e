"""Bumper switches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.robot.drivers.chip import Keys, SensorChip, device_errors
from shapechanger.robot.drivers.pins import EdgeInput, Pin
from shapechanger.robot.drivers.simulation import Edge, SimulatedSensor
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # Only simulations need these.
    from shapechanger.contract.world import Readings, World


class SwitchKeys(Keys, frozen=True, kw_only=True):
    """Keys of bumper switches.

    Attributes:
        pins: Pin of each switch.
        pull: "up" for switches to ground, "down" for switches to 3.3 V.
    """

    pins: Annotated[
        list[Pin], Meta(min_length=1, description=f"a list of pins, each {Pin.description}")
    ]
    pull: Literal["up", "down"] = "up"


class Switch:
    """One or more switches; see `SensorDriver`. Pushes between two reads are not missed."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        keys = SwitchKeys.of(plan.settings)
        self._name = f"Sensor {plan.name!r}"
        self._pressed_level = int(keys.pull == "down")
        self._was_pressed = False
        with device_errors(self._name):
            factory = hardware.pin_factory()
            self._inputs = [EdgeInput(p, keys.pull, factory, self._changed) for p in keys.pins]

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


class SimulatedSwitch(SimulatedSensor):
    """Bumper switches to ground (pull "up") or to 3.3 V, all pressed at once."""

    def __init__(self, plan: SensorPlan, world: World) -> None:
        keys = SwitchKeys.of(plan.settings)
        self._pins = keys.pins
        self._open = int(keys.pull == "up")
        self._pressed = False
        self.held = False  # Whether something outside the world presses them.
        super().__init__(levels=dict.fromkeys(keys.pins, self._open))

    def edges(self, start_ns: int, end_ns: int, seen: Readings) -> list[Edge]:
        """Return the edges of a push or its end."""
        pressed = seen.bumped or self.held
        if pressed == self._pressed:
            return []
        self._pressed = pressed
        return [Edge(end_ns, pin, self._open ^ pressed) for pin in self._pins]


SWITCH: Final = SensorChip(measures="bump", keys=SwitchKeys, open=Switch, simulate=SimulatedSwitch)
