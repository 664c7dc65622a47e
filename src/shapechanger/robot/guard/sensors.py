"""Sensors of the guard, merged into one set of quantities."""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import SENSORS, SensorDriver
from shapechanger.robot.hardware import Hardware

# Rank of a reading: if several sensors measure a quantity, the reading of the highest rank is used,
# such as the speed nearest to 0, so that a turning track does not hide a stalled one. Quantities
# that are not listed use the last reading.
_CAUTION: Final[dict[str, Callable[[float], float]]] = {
    "bump": operator.pos,
    "collision": operator.pos,
    "stall": operator.pos,
    "temperature": operator.pos,
    "distance": operator.neg,
    "battery": operator.neg,
    "speed": lambda m_per_s: -abs(m_per_s),
}


_ESTIMATED = "estimated"
"""Source of a speed that follows from the applied actions, and of a collision from a stall."""


@dataclass(frozen=True, slots=True)
class Sensing:
    """Sensor readings of one round.

    Attributes:
        quantities: Readings in SI units, keyed by name; see `GuardState.quantities`.
        sources: Name of the sensor behind each quantity, or "estimated".
        failures: Why a sensor failed, was slow or returned no finite value, keyed by its name.
        slow: Names of the failed sensors that took too long.
        silent: Names of the distance sensors that responded without a distance.
    """

    quantities: dict[str, float] = field(default_factory=dict[str, float])
    sources: dict[str, str] = field(default_factory=dict[str, str])
    failures: dict[str, str] = field(default_factory=dict[str, str])
    slow: set[str] = field(default_factory=set[str])
    silent: set[str] = field(default_factory=set[str])

    def merge(self, measured: Mapping[str, float], sensor: str) -> None:
        """Add the readings of one more sensor."""
        known = self.quantities
        for name, value in measured.items():
            caution = _CAUTION.get(name)
            if name not in known or not caution or caution(value) > caution(known[name]):
                known[name], self.sources[name] = value, sensor

    def conclude(self, *, speed: float | None, stalled: bool | None) -> None:
        """Add the quantities that follow from the readings.

        `speed` is the estimated speed, m/s, and `stalled` is None if stalls are not detected.
        """
        quantities, sources = self.quantities, self.sources
        if stalled is not None:
            quantities["stall"], sources["stall"] = float(stalled), sources["speed"]
        if "speed" not in quantities and speed is not None:
            quantities["speed"], sources["speed"] = speed, _ESTIMATED
        signs = [name for name in ("bump", "stall") if name in quantities]
        if signs:  # A collision is detected by a bumper, or else by a stall.
            sign = next((name for name in signs if quantities[name] > 0.0), signs[0])
            quantities["collision"] = float(quantities[sign] > 0.0)
            sources["collision"] = _ESTIMATED if sign == "stall" else sources[sign]


_MOST_READ_NS: Final = 20_000_000
"""Longest permitted response time of a sensor, ns: a slow sensor delays stops."""


class Sensors:
    """All sensors; one that fails or is slow is reported, and the others are read."""

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
        self._clock = hardware.clock
        self._ranging = {s.name for s in plan.sensors if s.measures == "distance"}
        self._drivers: list[tuple[str, SensorDriver]] = []
        with contextlib.ExitStack() as undo:
            undo.callback(self.close)
            for sensor in plan.sensors:
                driver = SENSORS[sensor.driver].open(sensor, hardware)
                self._drivers.append((sensor.name, driver))
            undo.pop_all()

    def read(self, now_ns: int, direction: float) -> Sensing:
        """Read all sensors."""
        sensing = Sensing()
        # A twin's clock is paused meanwhile, so its sensors are not slow on a slow machine.
        ended_ns = self._clock.now_ns()
        for name, driver in self._drivers:
            began_ns = ended_ns
            measured: dict[str, float] = {}
            try:
                measured = driver.read(now_ns, direction)
            except (RobotError, OSError) as error:
                sensing.failures[name] = str(error)
            ended_ns = self._clock.now_ns()
            if ended_ns - began_ns > _MOST_READ_NS:
                sensing.slow.add(name)
                text = f"It took more than {_MOST_READ_NS // 1_000_000} ms to answer."
                sensing.failures[name] = f"{sensing.failures.get(name, '')} {text}".lstrip()
            if not all(map(math.isfinite, measured.values())):
                sensing.failures.setdefault(name, "It returned a value that is not finite.")
                continue
            answers = name in self._ranging and name not in sensing.failures
            if answers and "distance" not in measured:
                sensing.silent.add(name)
            # A slow reading is still valid.
            sensing.merge(measured, name)
        return sensing

    def close(self) -> None:
        """Release all sensors."""
        while self._drivers:
            _, driver = self._drivers.pop()
            driver.close()
