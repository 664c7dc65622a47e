"""What every output driver does, and where each is found."""

from __future__ import annotations

import importlib
from typing import Final, Protocol

from shapechanger.errors import UnknownName
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

__all__ = ["OUTPUT_DRIVERS", "OutputDriver", "SharedDevice", "open_output"]

# Each module has `open_driver(plan, hardware)`. They are loaded when they are needed, so that the
# guard holds only its own drivers.
OUTPUT_DRIVERS: Final = {
    "hbridge": "shapechanger.robot.drivers.hbridge",
    "phase_enable": "shapechanger.robot.drivers.phase_enable",
    "servo": "shapechanger.robot.drivers.servo",
    "esc": "shapechanger.robot.drivers.esc",
    "dynamixel": "shapechanger.robot.drivers.dynamixel.output",
}
"""Module of each output driver, by its name in a profile."""


class OutputDriver(Protocol):
    """One motor, servo or controller."""

    def write(self, value: float, now_ns: int) -> float:
        """Move.

        Args:
            value: From -1, full left or backward, to 1, full right or forward; 0 is rest.
            now_ns: The time, for a controller that must wait before it obeys.

        Returns:
            The value that the output really has now.
        """
        ...

    def release(self) -> None:
        """Let go: no torque, no pulse."""
        ...

    def close(self) -> None:
        """Go to the safest level and let go of the pins."""
        ...


class SharedDevice(Protocol):
    """What several outputs are on, where it acts on all of them at once: a servo bus.

    Drivers on one have it as their attribute `device`.
    """

    def begin(self) -> None:
        """Make it ready, once all of its outputs are open; nothing moves.

        Raises:
            RobotError: If it does not answer, or is not what it should be.
        """
        ...

    def ready(self) -> None:
        """Forget what was wrong, before the robot is armed; nothing moves.

        Raises:
            RobotError: If something still is.
        """
        ...

    def flush(self, *, grip: bool) -> None:
        """Do what was written to its outputs.

        Args:
            grip: Whether outputs that have let go take hold.

        Raises:
            RobotError: If they do not.
        """
        ...


def open_output(plan: OutputPlan, hardware: Hardware) -> OutputDriver:
    """Open an output; it is at rest.

    Raises:
        UnknownName: If there is no such driver.
        RobotError: If the device does not answer.
    """
    if plan.driver not in OUTPUT_DRIVERS:
        raise UnknownName("output driver", plan.driver, OUTPUT_DRIVERS)
    return importlib.import_module(OUTPUT_DRIVERS[plan.driver]).open_driver(plan, hardware)
