"""Motors on an H-bridge with two inputs, such as L298N, DRV8833 or TB6612FNG.

One input turns the motor forward, the other backward, each with PWM. Some boards have a third input
that enables both.
"""

from __future__ import annotations

import math
from contextlib import ExitStack

from gpiozero import DigitalOutputDevice, Motor

from shapechanger.robot.drivers.duty import Duty
from shapechanger.robot.drivers.settings import in_words, number, whole
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware


class HBridge:
    """Bidirectional motor; see `OutputDriver`.

    The inputs are never on together: `Motor` turns one off before it turns the other on, and on a
    Pi `LowAtOncePin` makes that immediate.
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
        """Write a speed and return the applied one; see `OutputDriver.write`."""
        drive = math.copysign(self._duty.of(value), value)
        if drive != self._written:
            self._written = None  # A failed write may still have taken effect.
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
        """Set both inputs low and disable the bridge, so that the motor coasts."""
        self._written = None
        with in_words(self._name):
            try:
                if self._enable is not None:
                    self._enable.off()
            finally:
                self._stop()

    def close(self) -> None:
        """Set both inputs low; see `LowAtOncePin.close` for the pins afterwards."""
        if self._motor.closed:
            return
        with in_words(self._name), ExitStack() as stack:
            if self._enable is not None:
                stack.callback(self._enable.close)
            stack.callback(self._motor.close)
            self.release()

    def _stop(self) -> None:
        # Unlike in `Motor.stop`, one input goes low even if the other fails.
        try:
            self._motor.forward_device.off()
        finally:
            self._motor.backward_device.off()


def open_driver(plan: OutputPlan, hardware: Hardware) -> HBridge:
    """Open the motor at rest.

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
            # Not the one of `Motor`, which would be on before the first write.
            enabling = undo.enter_context(DigitalOutputDevice(enable, pin_factory=factory))
        motor = undo.enter_context(Motor(forward, backward, pin_factory=factory))
        for device in (motor.forward_device, motor.backward_device):
            device.frequency = whole(settings, "pwm_hz")
        bridge = HBridge(motor, enabling, duty, name)
        undo.pop_all()
    return bridge
