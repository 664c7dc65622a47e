"""A motor on an H-bridge with two inputs, such as L298N, DRV8833 or TB6612FNG.

One input turns it forward, the other one backward, each by its share of time (PWM). Some boards
have a third input that enables both.
"""

from __future__ import annotations

import math
from contextlib import ExitStack

from gpiozero import DigitalOutputDevice, Motor

from shapechanger.robot.drivers.gpio import Duty
from shapechanger.robot.drivers.settings import in_words, number, whole
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

__all__ = ["HBridge", "open_driver"]


class HBridge:
    """A motor that goes forward and backward; see `OutputDriver`.

    Never both inputs are on: `Motor` turns the one off before it turns the other one on, and on a
    Pi `LowAtOncePin` makes that off take effect at once.
    """

    def __init__(
        self, motor: Motor, enable: DigitalOutputDevice | None, duty: Duty, name: str
    ) -> None:
        self._motor = motor
        self._enable = enable
        self._duty = duty
        self._name = name
        self._written: float | None = None
        self.write(0.0, 0)

    def write(self, value: float, now_ns: int) -> float:
        """Turn the motor, and say how fast; see `OutputDriver.write`."""
        drive = math.copysign(self._duty.of(value), value)
        if drive != self._written:
            self._written = None  # What fails may have taken effect all the same.
            with in_words(self._name):
                if drive:
                    self._motor.value = drive
                else:
                    self._stop()
                if self._enable is not None:
                    self._enable.on()
            self._written = drive
        return math.copysign(self._duty.size_at(abs(drive)), drive) if drive else 0.0

    def release(self) -> None:
        """Both inputs low and the bridge disabled: the motor runs out."""
        self._written = None
        with in_words(self._name):
            try:
                if self._enable is not None:
                    self._enable.off()
            finally:
                self._stop()

    def close(self) -> None:
        """Both inputs low; see `LowAtOncePin.close` for what the pins do then."""
        if self._motor.closed:
            return
        with in_words(self._name), ExitStack() as stack:
            if self._enable is not None:
                stack.callback(self._enable.close)
            stack.callback(self._motor.close)
            self.release()

    def _stop(self) -> None:
        # Unlike `Motor.stop`, one input goes low also when the other one fails.
        try:
            self._motor.forward_device.off()
        finally:
            self._motor.backward_device.off()


def open_driver(plan: OutputPlan, hardware: Hardware) -> HBridge:
    """Open the motor; it stands.

    The settings are the BCM pins `forward`, `backward` and `enable` (-1 for none), `pwm_hz`,
    `start` and `full` (see `Duty`).
    """
    settings = plan.settings
    forward, backward = whole(settings, "forward"), whole(settings, "backward")
    enable = whole(settings, "enable")
    name = f"Output {plan.name!r} on GPIO{forward} and GPIO{backward}"
    duty = Duty(number(settings, "start"), number(settings, "full"))
    with in_words(name), ExitStack() as undo:
        factory = hardware.pin_factory()
        enabling = None
        if enable >= 0:
            # Ours and not that of `Motor`, which would be on before anything is written.
            enabling = undo.enter_context(DigitalOutputDevice(enable, pin_factory=factory))
        motor = undo.enter_context(Motor(forward, backward, pin_factory=factory))
        for device in (motor.forward_device, motor.backward_device):
            device.frequency = whole(settings, "pwm_hz")
        bridge = HBridge(motor, enabling, duty, name)
        undo.pop_all()
    return bridge
