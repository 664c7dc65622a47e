"""Driver of the tendons of a servo bus as a sensor: lengths, speeds and tensions."""

from __future__ import annotations

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.dynamixel.output import bus_at
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware


class TendonSensor:
    """Runs one cycle of the bus per reading; see `SensorDriver`.

    Args:
        plan: The sensor.
        hardware: Hardware of the bus.

    Raises:
        RobotError: If no output is on that bus.
    """

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        self._bus = bus_at(plan.settings["device"], hardware)

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Run a cycle and return its readings, without servos that did not answer.

        Args:
            now_ns: Time, ns.
            direction: Not used.

        Returns:
            For each tendon, such as FDP, `FDP/length`, its length beyond its zero, m, if it has
            one; `FDP/speed`, m/s, positive while it gets longer; and `FDP/tension`, N, at least 0.

        Raises:
            RobotError: If there is a fault.
        """
        state = self._bus.cycle(now_ns)
        if state.reason:
            raise RobotError(state.reason)
        readings: dict[str, float] = {}
        for name, servo in state.servos.items():
            if servo.length_m is not None:
                readings[f"{name}/length"] = servo.length_m
            readings[f"{name}/speed"] = servo.lengthening_m_per_s
            readings[f"{name}/tension"] = max(servo.tension_n, 0.0)
        return readings

    def close(self) -> None:
        """Do nothing: the bus belongs to the outputs."""


def open_driver(plan: SensorPlan, hardware: Hardware) -> TendonSensor:
    """Open the tendons of a bus whose outputs are open.

    Args:
        plan: The sensor.
        hardware: Hardware of the bus, the same as that of the outputs.
    """
    return TendonSensor(plan, hardware)
