"""Ultrasonic distance sensor HC-SR04.

Times and ranges: ElecFreaks, HC-SR04 ultrasonic ranging module, user guide. Its echo has 5 V; a Pi
takes 3.3 V, so a divider is needed.
"""

from __future__ import annotations

import threading
import time
from typing import Final

from gpiozero import DigitalOutputDevice

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.edges import EdgeInput
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware, RealClock

_TRIGGER_NS: Final = 10_000  # A pulse of 10 µs starts a ping.
_CYCLE_NS: Final = 60_000_000  # The user guide: at least 60 ms from ping to ping.
_MOST_MISSED: Final = 3  # Pings without an echo before it fails: about 200 ms, or 0.2 m at 1 m/s.
_SOUND_M_PER_S: Final = 343.2  # Dry air at 20 degrees Celsius; 0.6 m/s more for each degree.


class Hcsr04:
    """Distance sensor; see `SensorDriver`. It does not wait for the echo: the next read has it.

    The settings are the BCM pins `trigger` and `echo`, and `max_m`, the distance without an
    obstacle.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        settings = plan.settings
        self._name = f"Sensor {plan.name!r}"
        self._max_m: float = settings["max_m"]
        # Simulated pins need no pulse width.
        self._trigger_ns = _TRIGGER_NS if isinstance(hardware.clock, RealClock) else 0
        self._lock = threading.Lock()  # lgpio calls back from its own thread.
        self._rise: float | None = None
        self._echo_s: float | None = None
        self._answered = False  # Whether the line has changed since the last read.
        self._distance_m: float | None = None
        self._pinged_ns: int | None = None
        self._unanswered = 0  # Pings since the line changed.
        with device_errors(self._name):
            factory = hardware.pin_factory()
            self._ticks_diff = factory.ticks_diff
            self._trigger = DigitalOutputDevice(settings["trigger"], pin_factory=factory)
            self._echo = EdgeInput(settings["echo"], "down", factory, self._changed)

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the "distance" in m, at most `max_m`; empty before the first echo.

        Raises:
            RobotError: If three consecutive pings had no echo, so that the last distance is old.
        """
        with self._lock:
            echo_s, self._echo_s = self._echo_s, None
            answered, self._answered = self._answered, False
        if echo_s is not None:
            self._distance_m = min(echo_s * _SOUND_M_PER_S / 2.0, self._max_m)
        if answered:
            self._unanswered = 0
        if self._pinged_ns is None or now_ns - self._pinged_ns >= _CYCLE_NS:
            self._pinged_ns = now_ns
            self._unanswered += 1
            self._ping()
        if self._unanswered > _MOST_MISSED:
            self._distance_m = None
            raise RobotError(f"{self._name} receives no echo: check its wires and its 5 V supply.")
        return {} if self._distance_m is None else {"distance": self._distance_m}

    def close(self) -> None:
        """Close the pins."""
        self._trigger.close()
        self._echo.close()

    def _ping(self) -> None:
        with device_errors(self._name):
            self._trigger.on()
            # Spin: the shortest sleep takes several times as long, and the guard waits for it.
            if self._trigger_ns:
                end_ns = time.perf_counter_ns() + self._trigger_ns
                while time.perf_counter_ns() < end_ns:
                    pass
            self._trigger.off()

    def _changed(self, at_s: float, level: int) -> None:
        with self._lock:
            self._answered = True
            if level:
                self._rise = at_s
            elif self._rise is not None:
                self._echo_s = self._ticks_diff(at_s, self._rise)
                self._rise = None
