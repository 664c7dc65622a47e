"""Ultrasonic distance sensor HC-SR04.

Times and ranges: ElecFreaks, HC-SR04 ultrasonic ranging module, user guide. Its echo has 5 V; a Pi
takes 3.3 V, so a divider is needed.
"""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Annotated, Final

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import Keys, SensorChip, device_errors
from shapechanger.robot.drivers.pins import EdgeInput, Pin
from shapechanger.robot.drivers.simulation import Edge, SimulatedSensor
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # Only simulations need these.
    from shapechanger.contract.world import World

_TRIGGER_NS: Final = 10_000  # A pulse of 10 µs starts a ping.
_CYCLE_NS: Final = 60_000_000  # The user guide: at least 60 ms from ping to ping.
_MOST_MISSED: Final = 3  # Pings without an echo after which the next one fails, about 200 ms.
_SOUND_M_PER_S: Final = 343.2  # Dry air at 20 degrees Celsius; 0.6 m/s more for each degree.


class Hcsr04Keys(Keys, frozen=True, kw_only=True):
    """Keys of an HC-SR04.

    Attributes:
        trigger: Pin of its trigger.
        echo: Pin of its echo, through a divider to 3.3 V.
        max_m: Largest distance that is reported, also without an obstacle, m.
    """

    trigger: Pin
    echo: Pin
    max_m: Annotated[float, Meta(gt=0, le=5)] = 2.0


class Hcsr04:
    """Distance sensor; see `SensorDriver`. `read` returns the echo of an earlier ping."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        keys = Hcsr04Keys.of(plan.settings)
        self._name = f"Sensor {plan.name!r}"
        self._max_m = keys.max_m
        # Simulated pins need no pulse width.
        self._trigger_ns = _TRIGGER_NS if hardware.clock.is_real else 0
        self._lock = threading.Lock()  # lgpio calls back from its own thread.
        self._rise: float | None = None
        self._distance_m: float | None = None
        self._pinged_ns: int | None = None
        self._unanswered = 0  # Pings since the line changed.
        with device_errors(self._name):
            from gpiozero import DigitalOutputDevice

            factory = hardware.pin_factory()
            self._ticks_diff = factory.ticks_diff
            self._trigger = DigitalOutputDevice(keys.trigger, pin_factory=factory)
            self._echo = EdgeInput(keys.echo, "down", factory, self._changed)

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the "distance" in m, at most `max_m`; empty before the first echo.

        RobotError is raised after three pings without an echo: the last distance is then old.
        """
        if self._pinged_ns is None or now_ns - self._pinged_ns >= _CYCLE_NS:
            self._pinged_ns = now_ns
            with self._lock:
                self._unanswered += 1
            with device_errors(self._name):
                self._trigger.on()
                # Spin: the shortest sleep takes several times as long, and the guard waits for it.
                if self._trigger_ns:
                    end_ns = time.perf_counter_ns() + self._trigger_ns
                    while time.perf_counter_ns() < end_ns:
                        pass
                self._trigger.off()
        with self._lock:
            if self._unanswered <= _MOST_MISSED:
                return {} if self._distance_m is None else {"distance": self._distance_m}
            self._distance_m = None
        raise RobotError(f"{self._name} receives no echo: check its wires and its 5 V supply.")

    def close(self) -> None:
        """Close the pins."""
        self._trigger.close()
        self._echo.close()

    def _changed(self, at_s: float, level: int) -> None:
        with self._lock:
            self._unanswered = 0
            if level:
                self._rise = at_s
            elif self._rise is not None:
                echo_s = self._ticks_diff(at_s, self._rise)
                self._distance_m = min(echo_s * _SOUND_M_PER_S / 2.0, self._max_m)
                self._rise = None


# The echo line rises `_PING_NS` after the trigger, and is high for as long as the sound travels, at
# most 38 ms. The sensor measures 2 cm to 4 m.
_PING_NS: Final = 450_000
_NO_ECHO_NS: Final = 38_000_000
_NEAREST_M: Final = 0.02
_FARTHEST_M: Final = 4.0


class SimulatedHcsr04(SimulatedSensor):
    """An HC-SR04, which answers a ping at the falling edge of its trigger."""

    def __init__(self, plan: SensorPlan, world: World) -> None:
        self._keys = keys = Hcsr04Keys.of(plan.settings)
        self._world = world
        self._busy_until_ns = 0
        self.override_m: float | None = None  # Distance to measure, m; None for the true one.
        self.dead = False  # Whether it does not answer at all.
        super().__init__(levels={keys.echo: 0})

    def output_changed(self, t: int, pin: int, level: float) -> list[Edge]:
        """Return the edges of the echo."""
        if pin != self._keys.trigger or level or self.dead or t < self._busy_until_ns:
            return []
        distance = self._world.distance_m() if self.override_m is None else self.override_m
        echo_ns = _NO_ECHO_NS
        if distance <= _FARTHEST_M:
            echo_ns = round(2e9 * max(distance, _NEAREST_M) / _SOUND_M_PER_S)
        self._busy_until_ns = t + _PING_NS + echo_ns
        echo = self._keys.echo
        return [Edge(t + _PING_NS, echo, 1), Edge(self._busy_until_ns, echo, 0)]


HCSR04: Final = SensorChip(
    measures="distance", keys=Hcsr04Keys, open=Hcsr04, simulate=SimulatedHcsr04
)
