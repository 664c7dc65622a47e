"""Motors whose speed is the duty cycle of a pin: H-bridges, and drivers in phase/enable mode."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from typing import Annotated, Any, Final

from msgspec import Meta

from shapechanger.contract.duty import Duty
from shapechanger.contract.plan import OutputPlan
from shapechanger.robot.drivers.chip import OutputChip
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.drivers.keys import KeyMistake, Keys
from shapechanger.robot.drivers.pins import NO_PIN, OptionalPin, Pin
from shapechanger.robot.drivers.simulation import DutyOf, Levels, WiredOutput
from shapechanger.robot.hardware import Hardware


class _DutyKeys(Keys, frozen=True, kw_only=True):
    """Keys of a motor whose speed is a duty cycle.

    Attributes:
        pwm_hz: Frequency of the PWM, Hz; gpiozero's takes up to 10 kHz.
        start: Smallest duty that moves the motor; values just above 0 get it.
        full: Duty at full speed.
    """

    pwm_hz: Annotated[int, Meta(ge=1, le=10_000)] = 50
    start: Annotated[float, Meta(ge=0, le=1)] = 0.0
    full: Annotated[float, Meta(gt=0, le=1)] = 1.0

    def __post_init__(self) -> None:
        """Refuse an empty range of duties."""
        if not self.start < self.full:
            raise KeyMistake("start", f"must be below full, which is {self.full:g}")


class HBridgeKeys(_DutyKeys, frozen=True, kw_only=True):
    """Keys of an H-bridge.

    Attributes:
        forward: Input for forward or right.
        backward: Input for backward or left.
        enable: Input that enables both; -1 for none.
    """

    forward: Pin
    backward: Pin
    enable: OptionalPin = NO_PIN


class PhaseEnableKeys(_DutyKeys, frozen=True, kw_only=True):
    """Keys of a driver in phase/enable mode.

    Attributes:
        phase: Input for the direction; high is backward.
        enable: Input for the speed.
    """

    phase: Pin
    enable: Pin


class _DutyMotor:
    """Bidirectional motor; see `OutputDriver`.

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
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        from gpiozero import DigitalOutputDevice, Motor  # A twin's worlds need no gpiozero.

        super().__init__(plan, ("forward", "backward"))
        settings = plan.settings
        with device_errors(self._name), ExitStack() as undo:
            factory = hardware.pin_factory()
            self._enable: Any = None
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
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        from gpiozero import PhaseEnableMotor

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


def _wired_hbridge(plan: OutputPlan, rest: float, duty: DutyOf) -> Callable[[Levels], WiredOutput]:
    forward, backward, enable = (plan.settings[key] for key in ("forward", "backward", "enable"))

    def state(levels: Levels) -> WiredOutput:
        drive = duty(levels, forward) - duty(levels, backward)
        return _turning(plan, drive * (duty(levels, enable) if enable >= 0 else 1.0), rest)

    return state


def _wired_phase_enable(
    plan: OutputPlan, rest: float, duty: DutyOf
) -> Callable[[Levels], WiredOutput]:
    enable, phase = plan.settings["enable"], plan.settings["phase"]

    def state(levels: Levels) -> WiredOutput:
        # A phase that is high part of the time turns the motor back and forth.
        return _turning(plan, duty(levels, enable) * (1.0 - 2.0 * duty(levels, phase)), rest)

    return state


def _turning(plan: OutputPlan, drive: float, rest: float) -> WiredOutput:
    size = Duty(plan.settings["start"], plan.settings["full"]).size_at(abs(drive))
    value = math.copysign(size, drive)
    return WiredOutput(value, abs(value - rest) <= (0.01 if rest else 0.0))


_OFF: Final = WiredOutput(0.0, True)

HBRIDGE: Final = OutputChip(keys=HBridgeKeys, open=HBridge, wire=_wired_hbridge, unpowered=_OFF)
"""A motor on an H-bridge."""

PHASE_ENABLE: Final = OutputChip(
    keys=PhaseEnableKeys, open=PhaseEnable, wire=_wired_phase_enable, unpowered=_OFF
)
"""A motor on a driver in phase/enable mode."""
