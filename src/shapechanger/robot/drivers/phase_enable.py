"""A motor on a driver with a direction and a speed input, such as DRV8835 as phase/enable."""

from __future__ import annotations

import math
from contextlib import ExitStack

from gpiozero import PhaseEnableMotor

from shapechanger.robot.drivers.gpio import Duty
from shapechanger.robot.drivers.settings import in_words, number, whole
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

__all__ = ["PhaseEnable", "open_driver"]


class PhaseEnable:
    """A motor that goes forward and backward; see `OutputDriver`.

    The speed is zero while the direction changes: `PhaseEnableMotor` sees to that, and on a Pi
    `LowAtOncePin` makes it take effect at once.
    """

    def __init__(self, motor: PhaseEnableMotor, duty: Duty, name: str) -> None:
        self._motor = motor
        self._duty = duty
        self._name = name
        self._written: float | None = None
        self.write(0.0, 0)

    def write(self, value: float, now_ns: int) -> float:
        """Turn the motor, and say how fast; see `OutputDriver.write`."""
        drive = math.copysign(self._duty.of(value), value)
        if drive != self._written:
            written = self._written
            self._written = None  # What fails may have taken effect all the same.
            with in_words(self._name):
                # gpiozero turns the motor off before each new speed, also in the same direction,
                # which would make it stutter.
                if written is not None and drive * written > 0.0:
                    self._motor.enable_device.value = abs(drive)
                else:
                    self._motor.value = drive
            self._written = drive
        return math.copysign(self._duty.size_at(abs(drive)), drive) if drive else 0.0

    def release(self) -> None:
        """No speed; such drivers brake then, and cannot let go."""
        self._written = None
        with in_words(self._name):
            self._motor.stop()

    def close(self) -> None:
        """Both inputs low; see `LowAtOncePin.close` for what the pins do then."""
        if self._motor.closed:
            return
        with in_words(self._name), ExitStack() as stack:
            stack.callback(self._motor.close)
            self.release()
            self._motor.phase_device.off()  # A plain output would keep its level.


def open_driver(plan: OutputPlan, hardware: Hardware) -> PhaseEnable:
    """Open the motor; it stands.

    The settings are the BCM pins `phase` (high is backward) and `enable` (speed), `pwm_hz`, `start`
    and `full` (see `Duty`).
    """
    settings = plan.settings
    phase, enable = whole(settings, "phase"), whole(settings, "enable")
    name = f"Output {plan.name!r} on GPIO{phase} and GPIO{enable}"
    duty = Duty(number(settings, "start"), number(settings, "full"))
    with in_words(name), ExitStack() as undo:
        motor = PhaseEnableMotor(phase, enable, pin_factory=hardware.pin_factory())
        undo.callback(motor.close)
        motor.enable_device.frequency = whole(settings, "pwm_hz")
        driver = PhaseEnable(motor, duty, name)
        undo.pop_all()
    return driver
