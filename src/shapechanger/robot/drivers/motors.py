"""Motors whose speed is the duty cycle of a pin: H-bridges, and drivers in phase/enable mode."""

from __future__ import annotations

import math
from contextlib import ExitStack

from gpiozero import DigitalOutputDevice, Motor, PhaseEnableMotor

from shapechanger.robot.drivers.duty import Duty
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware


class _DutyMotor:
    """Bidirectional motor; see `OutputDriver`.

    All of them have the settings `pwm_hz`, `start` and `full` (see `Duty`).

    Args:
        plan: The output.
        pins: Settings that hold the two pins of the motor.
    """

    def __init__(self, plan: OutputPlan, pins: tuple[str, str]) -> None:
        first, second = (plan.settings[key] for key in pins)
        self._name = f"Output {plan.name!r} on GPIO{first} and GPIO{second}"
        self._duty = Duty(plan.settings["start"], plan.settings["full"])
        self._written: float | None = None
        self._opened = ExitStack()
        self._is_closed = False

    def write(self, value: float, now_ns: int) -> float:
        """Write a speed and return the applied one; see `OutputDriver.write`."""
        drive = math.copysign(self._duty.of(value), value)
        if drive != self._written:
            # A failed write may still have taken effect.
            written, self._written = self._written, None
            with device_errors(self._name):
                self._drive(drive, written)
            self._written = drive
        return math.copysign(self._duty.size_at(abs(drive)), drive) if drive else 0.0

    def release(self) -> None:
        """Set the speed to zero, and disable a bridge that can be disabled."""
        self._written = None
        with device_errors(self._name):
            self._stop()

    def close(self) -> None:
        """Set all inputs low; see `LowAtOncePin.close` for the pins afterwards."""
        if not self._is_closed:
            self._is_closed = True
            with device_errors(self._name), self._opened:
                self.release()

    def _drive(self, drive: float, written: float | None) -> None:
        """Set a signed duty; `written` is the previous one, or None if that is in doubt."""
        raise NotImplementedError

    def _stop(self) -> None:
        raise NotImplementedError


class HBridge(_DutyMotor):
    """Motor on an H-bridge with two inputs, such as L298N, DRV8833 or TB6612FNG.

    One input turns the motor forward, the other backward, each with PWM. They are never on
    together: `Motor` turns one off before it turns the other on, and on a Pi `LowAtOncePin` makes
    that immediate. Some boards have a third input that enables both. A released motor coasts.

    The settings are the BCM pins `forward`, `backward` and `enable` (-1 for none).
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        super().__init__(plan, ("forward", "backward"))
        settings = plan.settings
        with device_errors(self._name), ExitStack() as undo:
            factory = hardware.pin_factory()
            self._enable: DigitalOutputDevice | None = None
            if settings["enable"] >= 0:
                # Not the one of `Motor`, which would be on before the first write.
                self._enable = DigitalOutputDevice(settings["enable"], pin_factory=factory)
                undo.callback(self._enable.close)
            self._motor = Motor(settings["forward"], settings["backward"], pin_factory=factory)
            undo.callback(self._motor.close)
            for device in (self._motor.forward_device, self._motor.backward_device):
                device.frequency = settings["pwm_hz"]
            self.write(0.0, 0)
            self._opened = undo.pop_all()

    def _drive(self, drive: float, written: float | None) -> None:
        if drive:
            self._motor.value = drive
        else:
            self._set_low()
        if self._enable is not None:
            self._enable.on()

    def _stop(self) -> None:
        try:
            if self._enable is not None:
                self._enable.off()
        finally:
            self._set_low()

    def _set_low(self) -> None:
        # Unlike in `Motor.stop`, one input goes low even if the other fails.
        try:
            self._motor.forward_device.off()
        finally:
            self._motor.backward_device.off()


class PhaseEnable(_DutyMotor):
    """Motor on a driver with direction and speed inputs, such as DRV8835 in phase/enable mode.

    The speed is zero while the direction changes: `PhaseEnableMotor` ensures that, and on a Pi
    `LowAtOncePin` makes it immediate. Such drivers brake when released, and cannot coast.

    The settings are the BCM pins `phase` (high is backward) and `enable` (speed).
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        super().__init__(plan, ("phase", "enable"))
        pins = plan.settings["phase"], plan.settings["enable"]
        with device_errors(self._name), ExitStack() as undo:
            self._motor = PhaseEnableMotor(*pins, pin_factory=hardware.pin_factory())
            undo.callback(self._motor.close)
            # A plain output would keep its level.
            undo.callback(self._motor.phase_device.off)
            self._motor.enable_device.frequency = plan.settings["pwm_hz"]
            self.write(0.0, 0)
            self._opened = undo.pop_all()

    def _drive(self, drive: float, written: float | None) -> None:
        # gpiozero turns the motor off before each new speed, also in the same direction, which
        # would make it stutter.
        if written is not None and drive * written > 0.0:
            self._motor.enable_device.value = abs(drive)
        else:
            self._motor.value = drive

    def _stop(self) -> None:
        self._motor.stop()
