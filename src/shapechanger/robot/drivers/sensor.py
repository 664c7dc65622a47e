"""Interface of sensor drivers, and their registry."""

from __future__ import annotations

import importlib
from typing import Final, Protocol

from shapechanger.errors import UnknownName
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware

SENSOR_DRIVERS: Final = {
    "encoder": "shapechanger.robot.drivers.encoder",
    "switch": "shapechanger.robot.drivers.switch",
    "hcsr04": "shapechanger.robot.drivers.hcsr04",
    "mpu6050": "shapechanger.robot.drivers.mpu6050",
    "ina219": "shapechanger.robot.drivers.ina219",
    "as5600": "shapechanger.robot.drivers.as5600",
    "cpu_temperature": "shapechanger.robot.drivers.cpu_temperature",
    "dynamixel": "shapechanger.robot.drivers.dynamixel.sensor",
}
"""Module of each sensor driver, by name; each has `open_driver(plan, hardware)`."""


class SensorDriver(Protocol):
    """Driver of one sensor, without threads, that blocks for at most a few milliseconds."""

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the measurements by name, in SI units, as in `GuardState.quantities`.

        Args:
            now_ns: The time.
            direction: Sign of the propulsion, for a sensor that cannot tell forward from backward.

        Raises:
            RobotError: If the sensor does not respond.
        """
        ...

    def close(self) -> None:
        """Close the pins."""
        ...


def open_sensor(plan: SensorPlan, hardware: Hardware) -> SensorDriver:
    """Open a sensor.

    Args:
        plan: The sensor.
        hardware: The pins and buses of this robot.

    Raises:
        UnknownName: If there is no such driver.
        RobotError: If the device does not respond.
    """
    if plan.driver not in SENSOR_DRIVERS:
        raise UnknownName("sensor driver", plan.driver, SENSOR_DRIVERS)
    return importlib.import_module(SENSOR_DRIVERS[plan.driver]).open_driver(plan, hardware)
