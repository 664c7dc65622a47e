"""All sensors of the guard as one."""

from __future__ import annotations

import math
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.sensor import SensorDriver, open_sensor
from shapechanger.robot.guard.merging import merge
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.senses import Sensing
from shapechanger.robot.hardware import Hardware

__all__ = ["MOST_READ_NS", "Sensors"]

MOST_READ_NS: Final = 20_000_000
"""How long a sensor may take to answer, ns: for so long nothing can be stopped."""


class Sensors:
    """Reads all sensors; one that fails or is slow is named, and the others go on.

    Args:
        plan: The robot.
        hardware: Where the sensors are.

    Raises:
        RobotError: If a sensor does not answer.
    """

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
        self._clock = hardware.clock
        self._ranging = {s.name for s in plan.sensors if s.measures == "distance"}
        self._drivers: list[tuple[str, SensorDriver]] = []
        try:
            for sensor in plan.sensors:
                self._drivers.append((sensor.name, open_sensor(sensor, hardware)))
        except BaseException:
            self.close()
            raise

    def read(self, now_ns: int, direction: float) -> Sensing:
        """What they say now.

        Args:
            now_ns: The time.
            direction: Sign of the propulsion.
        """
        quantities: dict[str, float] = {}
        sources: dict[str, str] = {}
        failures: dict[str, str] = {}
        slow: set[str] = set()
        silent: set[str] = set()
        for name, driver in self._drivers:
            # A twin's time stands still meanwhile, so that its runs are the same on any machine.
            began_ns = self._clock.now_ns()
            measured: dict[str, float] = {}
            try:
                measured = driver.read(now_ns, direction)
            except (RobotError, OSError) as error:
                failures[name] = str(error)
            if self._clock.now_ns() - began_ns > MOST_READ_NS:
                slow.add(name)
                words = f"It took more than {MOST_READ_NS // 1_000_000} ms to answer."
                failures[name] = f"{failures.get(name, '')} {words}".lstrip()
            if not all(map(math.isfinite, measured.values())):
                failures.setdefault(name, "It says what is no number.")
                continue
            if name in self._ranging and name not in failures and "distance" not in measured:
                silent.add(name)
            # What a slow one says is true all the same.
            merge(quantities, sources, measured, name)
        return Sensing(quantities, sources, failures, frozenset(slow), frozenset(silent))

    def close(self) -> None:
        """Let go of all sensors."""
        while self._drivers:
            _, driver = self._drivers.pop()
            driver.close()
