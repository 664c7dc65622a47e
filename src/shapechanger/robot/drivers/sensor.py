"""Interface of sensor drivers, and their registry."""

from __future__ import annotations

from typing import Final, Protocol

from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware, load

SENSOR_DRIVERS: Final = {
    "encoder": "shapechanger.robot.drivers.encoder:Encoder",
    "switch": "shapechanger.robot.drivers.switch:Switch",
    "hcsr04": "shapechanger.robot.drivers.hcsr04:Hcsr04",
    "mpu6050": "shapechanger.robot.drivers.mpu6050:Mpu6050",
    "ina219": "shapechanger.robot.drivers.ina219:Ina219",
    "as5600": "shapechanger.robot.drivers.as5600:open_driver",
    "cpu_temperature": "shapechanger.robot.drivers.cpu_temperature:CpuTemperature",
    "bus_servo": "shapechanger.robot.drivers.servos.output:TendonSensor",
}
"""MODULE:NAME of each sensor driver, by its name in a profile; called with plan and hardware."""


class SensorDriver(Protocol):
    """Driver of one sensor, without threads, that blocks for at most a few milliseconds."""

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the measurements by name, in SI units, as in `GuardState.quantities`.

        Args:
            now_ns: Monotonic time, ns.
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
        RobotError: If the device does not respond.
    """
    return load(SENSOR_DRIVERS[plan.driver])(plan, hardware)
