"""The tendons of a servo bus as a sensor: lengths, speeds and tensions."""

from __future__ import annotations

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.shared import bus_at
from shapechanger.robot.drivers.settings import text
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware

__all__ = ["TendonSensor", "open_driver"]


class TendonSensor:
    """Runs a cycle of the bus in each reading; see `SensorDriver`.

    Args:
        plan: Which bus.
        hardware: Where it is.

    Raises:
        RobotError: If no output is on that bus.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        self._bus = bus_at(text(plan.settings, "device"), hardware)

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """What the servos say in this cycle; who was not heard is left out.

        Returns:
            For each tendon `FDP/length`, m beyond its zero, where it has one, `FDP/speed`, m/s,
            above 0 while it gets longer, and `FDP/tension`, N, at least 0.

        Raises:
            RobotError: If there is a fault, and what it is.
        """
        state = self._bus.cycle(now_ns)
        if state.reason:
            raise RobotError(state.reason)
        said: dict[str, float] = {}
        for name, servo in state.servos.items():
            if servo.length_m is not None:
                said[f"{name}/length"] = servo.length_m
            said[f"{name}/speed"] = servo.lengthening_m_per_s
            said[f"{name}/tension"] = max(servo.tension_n, 0.0)
        return said

    def close(self) -> None:
        """Nothing: the bus belongs to the outputs."""


def open_driver(plan: SensorPlan, hardware: Hardware) -> TendonSensor:
    """The tendons of a bus whose outputs are open."""
    return TendonSensor(plan, hardware)
