"""One tendon as an output: 0 is its pretension, 1 the most that it may pull."""

from __future__ import annotations

from shapechanger.robot.drivers.dynamixel.shared import SharedBus, join_bus
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

__all__ = ["TendonOutput", "open_driver"]


class TendonOutput:
    """A servo on a bus; see `OutputDriver`.

    Args:
        plan: The servo.
        hardware: Where its bus is.

    Attributes:
        device: The bus, which acts when all outputs have been written.

    Raises:
        RobotError: If the servo cannot be as its settings say.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        self.device: SharedBus
        self.device, servo = join_bus(plan, hardware)
        self._name = plan.name
        self._least_n, self._most_n = servo.pretension_n, servo.most_tension_n

    def write(self, value: float, now_ns: int) -> float:
        """Pull so much from the next flush on; below 0 counts as 0.

        Returns:
            The same, or 0 where the bus has a fault and lets go.
        """
        value = min(max(value, 0.0), 1.0)
        tension = self._least_n + value * (self._most_n - self._least_n)
        return value if self.device.stage(self._name, tension) else 0.0

    def release(self) -> None:
        """Take the torque from it and all others on its bus."""
        self.device.let_go()

    def close(self) -> None:
        """Let go, and leave the bus."""
        self.device.leave(self._name)


def open_driver(plan: OutputPlan, hardware: Hardware) -> TendonOutput:
    """Join the bus; nothing is sent yet."""
    return TendonOutput(plan, hardware)
