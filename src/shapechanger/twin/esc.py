"""How a hobby speed controller obeys: only after neutral, and with a brake before its reverse."""

from __future__ import annotations

from typing import Final

from shapechanger.robot.drivers.settings import number, text
from shapechanger.robot.guard.plan import OutputPlan

__all__ = ["SpeedController"]

# It is content with a little less than what a driver waits.
_ARM_SHARE: Final = 0.8


class SpeedController:
    """What a controller makes of the value of its pulses.

    With `reverse` "double" the first pulses backward after going forward brake; only those that
    follow another neutral go backward.

    Args:
        plan: The output.
    """

    def __init__(self, plan: OutputPlan) -> None:
        self._reverse = text(plan.settings, "reverse")
        self._arm_ns = number(plan.settings, "arm_s") * 1e9 * _ARM_SHARE
        self._neutral_since_ns: int | None = None
        self._armed = False
        self._braked = False
        self._reverses = False

    def obey(self, value: float, pulses: bool, now_ns: int) -> float:
        """What the motor gets.

        Args:
            value: What the pulses say, -1 to 1.
            pulses: Whether there are any; without, it stops and wants to see neutral again.
            now_ns: The time.
        """
        if not pulses:
            self._neutral_since_ns = None
            self._armed = self._braked = self._reverses = False
            return 0.0
        if value == 0.0:
            if self._neutral_since_ns is None:
                self._neutral_since_ns = now_ns
            self._armed = self._armed or now_ns - self._neutral_since_ns >= self._arm_ns
            self._reverses = self._reverses or self._braked
            return 0.0
        self._neutral_since_ns = None
        if not self._armed:
            return 0.0
        if value > 0.0:
            self._braked = self._reverses = False
            return value
        if self._reverse == "direct" or (self._reverse == "double" and self._reverses):
            return value
        self._braked = True
        return 0.0
