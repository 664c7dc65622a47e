"""Interface of output drivers, and their registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware, load

# Loaded on demand, so that the guard loads only its own drivers.
OUTPUT_DRIVERS: Final = {
    "hbridge": "shapechanger.robot.drivers.motors:HBridge",
    "phase_enable": "shapechanger.robot.drivers.motors:PhaseEnable",
    "servo": "shapechanger.robot.drivers.servo:ServoDriver",
    "esc": "shapechanger.robot.drivers.esc:Esc",
    "bus_servo": "shapechanger.robot.drivers.servos.output:TendonOutput",
}
"""MODULE:NAME of each output driver, by its name in a profile; called with plan and hardware."""


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

    def ready(self, alive: Callable[[], object]) -> None:
        """Clear faults before the robot is armed, without moving anything.

        Args:
            alive: Feeds the enable line and the supervisor; called at least every 50 ms.

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
        RobotError: If the device does not respond.
    """
    return load(OUTPUT_DRIVERS[plan.driver])(plan, hardware)
