"""Motors on a driver with direction and speed inputs, such as DRV8835 in phase/enable mode."""

from __future__ import annotations

import math
from contextlib import ExitStack

from gpiozero import PhaseEnableMotor

from shapechanger.robot.drivers.duty import Duty
from shapechanger.robot.drivers.settings import in_words, number, whole
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware


class PhaseEnable:
    """Bidirectional motor; see `OutputDriver`.

    The speed is zero while the direction changes: `PhaseEnableMotor` ensures that, and on a Pi
    `LowAtOncePin` makes it immediate.
    """

    def __init__(self, motor: PhaseEnableMotor, duty: Duty, name: str) -> None:
        self._motor = motor
        self._duty = duty
        self._name = name
        self._written: float | None = None
        self.write(0.0, 0)

    def write(self, value: float, now_ns: int) -> float:
        """Write a speed and return the applied one; see `OutputDriver.write`."""
        drive = math.copysign(self._duty.of(value), value)
        if drive != self._written:
            written = self._written
            self._written = None  # A failed write may still have taken effect.
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
        """Set the speed to zero; such drivers then brake and cannot coast."""
        self._written = None
        with in_words(self._name):
            self._motor.stop()

    def close(self) -> None:
        """Set both inputs low; see `LowAtOncePin.close` for the pins afterwards."""
        if self._motor.closed:
            return
        with in_words(self._name), ExitStack() as stack:
            stack.callback(self._motor.close)
            self.release()
            self._motor.phase_device.off()  # A plain output would keep its level.


def open_driver(plan: OutputPlan, hardware: Hardware) -> PhaseEnable:
    """Open the motor at rest.

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
