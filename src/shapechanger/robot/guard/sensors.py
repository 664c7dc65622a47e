"""All sensors of the guard as one."""

from __future__ import annotations

import math

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.sensor import SensorDriver, open_sensor
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.guard.senses import Sensing
from shapechanger.robot.hardware import Hardware

__all__ = ["Sensors"]


class Sensors:
    """Reads all sensors; one that fails is named, and the others go on.

    Args:
        plan: The robot.
        hardware: Where the sensors are.

    Raises:
        RobotError: If a sensor does not answer.
    """

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
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
        for name, driver in self._drivers:
            try:
                measured = driver.read(now_ns, direction)
            except (RobotError, OSError) as error:
                failures[name] = str(error)
                continue
            if not all(map(math.isfinite, measured.values())):
                failures[name] = "It says what is no number."
                continue
            quantities |= measured
            sources |= dict.fromkeys(measured, name)
        return Sensing(quantities, sources, failures)

    def close(self) -> None:
        """Let go of all sensors."""
        while self._drivers:
            _, driver = self._drivers.pop()
            driver.close()
