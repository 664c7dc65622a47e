"""Interface of output drivers, and their registry."""

from __future__ import annotations

import importlib
from typing import Final, Protocol

from shapechanger.errors import UnknownName
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

# Each module has `open_driver(plan, hardware)` and is loaded on demand, so that the guard loads
# only its own drivers.
OUTPUT_DRIVERS: Final = {
    "hbridge": "shapechanger.robot.drivers.hbridge",
    "phase_enable": "shapechanger.robot.drivers.phase_enable",
    "servo": "shapechanger.robot.drivers.servo",
    "esc": "shapechanger.robot.drivers.esc",
    "dynamixel": "shapechanger.robot.drivers.dynamixel.output",
}
"""Module of each output driver, by its name in a profile."""


class OutputDriver(Protocol):
    """Driver of one motor, servo or controller."""

    def write(self, value: float, now_ns: int) -> float:
        """Write a value.

        Args:
            value: From -1, full left or backward, to 1, full right or forward; 0 is rest.
            now_ns: Monotonic time, ns, for controllers with sequences.

        Returns:
            The applied value.
        """
        ...

    def release(self) -> None:
        """Release the output: no torque, no pulse."""
        ...

    def close(self) -> None:
        """Set the safest level and close the pins."""
        ...


class SharedDevice(Protocol):
    """Device shared by several outputs and written once for all of them: a servo bus.

    Its drivers refer to it by their attribute `device`.
    """

    def begin(self) -> None:
        """Start the device once all of its outputs are open, without moving anything.

        Raises:
            RobotError: If it does not respond, or is not the expected device.
        """
        ...

    def ready(self) -> None:
        """Clear faults before the robot is armed, without moving anything.

        Raises:
            RobotError: If a fault persists.
        """
        ...

    def flush(self, *, grip: bool) -> None:
        """Send what was written to its outputs.

        Args:
            grip: Whether released outputs are energised again.

        Raises:
            RobotError: If an output does not obey.
        """
        ...


def open_output(plan: OutputPlan, hardware: Hardware) -> OutputDriver:
    """Open an output at rest.

    Args:
        plan: The output.
        hardware: The pins and buses of this robot.

    Raises:
        UnknownName: If there is no such driver.
        RobotError: If the device does not respond.
    """
    if plan.driver not in OUTPUT_DRIVERS:
        raise UnknownName("output driver", plan.driver, OUTPUT_DRIVERS)
    return importlib.import_module(OUTPUT_DRIVERS[plan.driver]).open_driver(plan, hardware)
