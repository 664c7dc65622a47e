"""Motors whose speed is the duty cycle of a pin: H-bridges, and drivers in phase/enable mode."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from typing import Annotated, Any, Final

from msgspec import Meta

from shapechanger.contract.duty import Duty
from shapechanger.contract.plan import OutputPlan
from shapechanger.robot.drivers.chip import KeyMistake, Keys, OutputChip, device_errors
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

    @property
    def duty(self) -> Duty:
        """Duty of a speed, and the reverse."""
        return Duty(self.start, self.full)


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
    """Bidirectional motor on two pins; see `OutputDriver`."""

    def __init__(self, plan: OutputPlan, duty: Duty, first: Pin, second: Pin) -> None:
        self._name = f"Output {plan.name!r} on GPIO{first} and GPIO{second}"
        self._duty = duty
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

        keys = HBridgeKeys.of(plan.settings)
        super().__init__(plan, keys.duty, keys.forward, keys.backward)
        with device_errors(self._name), ExitStack() as undo:
            factory = hardware.pin_factory()
            self._enable: Any = None
            if keys.enable != NO_PIN:
                # Not the one of `Motor`, which would be on before the first write.
                self._enable = DigitalOutputDevice(keys.enable, pin_factory=factory)
                undo.callback(self._enable.close)
            self._motor = Motor(keys.forward, keys.backward, pin_factory=factory)
            undo.callback(self._motor.close)
            for device in (self._motor.forward_device, self._motor.backward_device):
                device.frequency = keys.pwm_hz
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
        with ExitStack() as stack:
            stack.callback(self._set_low)
            if self._enable is not None:
                self._enable.off()

    def _set_low(self) -> None:
        # Unlike in `Motor.stop`, one input goes low even if the other fails.
        with ExitStack() as stack:
            stack.callback(self._motor.backward_device.off)
            self._motor.forward_device.off()


class PhaseEnable(_DutyMotor):
    """Motor on a driver with direction and speed inputs, such as DRV8835 in phase/enable mode.

    The speed is zero while the direction changes: `PhaseEnableMotor` ensures that, and on a Pi
    `LowAtOncePin` makes it immediate. Such drivers brake when released, and cannot coast.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        from gpiozero import PhaseEnableMotor

        keys = PhaseEnableKeys.of(plan.settings)
        super().__init__(plan, keys.duty, keys.phase, keys.enable)
        with device_errors(self._name), ExitStack() as undo:
            factory = hardware.pin_factory()
            self._motor = PhaseEnableMotor(keys.phase, keys.enable, pin_factory=factory)
            undo.callback(self._motor.close)
            # A plain output would keep its level.
            undo.callback(self._motor.phase_device.off)
            self._motor.enable_device.frequency = keys.pwm_hz
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
    keys = HBridgeKeys.of(plan.settings)

    def state(levels: Levels) -> WiredOutput:
        enabled = 1.0 if keys.enable == NO_PIN else duty(levels, keys.enable)
        drive = duty(levels, keys.forward) - duty(levels, keys.backward)
        return _turning(keys.duty, drive * enabled, rest)

    return state


def _wired_phase_enable(
    plan: OutputPlan, rest: float, duty: DutyOf
) -> Callable[[Levels], WiredOutput]:
    keys = PhaseEnableKeys.of(plan.settings)

    def state(levels: Levels) -> WiredOutput:
        # A phase that is high part of the time turns the motor back and forth.
        sign = 1.0 - 2.0 * duty(levels, keys.phase)
        return _turning(keys.duty, duty(levels, keys.enable) * sign, rest)

    return state


def _turning(duty: Duty, drive: float, rest: float) -> WiredOutput:
    value = math.copysign(duty.size_at(abs(drive)), drive)
    return WiredOutput(value, abs(value - rest) <= (0.01 if rest else 0.0))


_OFF: Final = WiredOutput(0.0, True)

_LIT_ENABLE: Final = ("enable", " enable", 1.0)

HBRIDGE: Final = OutputChip(
    keys=HBridgeKeys,
    open=HBridge,
    wire=_wired_hbridge,
    unpowered=_OFF,
    lights=(("forward", " forward", 1.0), ("backward", " backward", -1.0), _LIT_ENABLE),
)
"""A motor on an H-bridge."""

PHASE_ENABLE: Final = OutputChip(
    keys=PhaseEnableKeys,
    open=PhaseEnable,
    wire=_wired_phase_enable,
    unpowered=_OFF,
    lights=(_LIT_ENABLE, ("phase", " backward", -1.0)),
)
"""A motor on a driver in phase/enable mode."""
