"""Motors whose speed is the duty cycle of a pin: H-bridges, and drivers in phase/enable mode."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from typing import Annotated, Any, Final

from msgspec import Meta

from shapechanger.contract.limits import Duty
from shapechanger.contract.plan import OutputPlan
from shapechanger.robot.drivers.chip import KeyMistake, Keys, OutputChip, device_errors
from shapechanger.robot.drivers.pins import NO_PIN, OptionalPin, Pin
from shapechanger.robot.drivers.simulation import DutyOf, Levels, WiredOutput
from shapechanger.robot.hardware import Hardware


class _DutyKeys(Keys, frozen=True, kw_only=True):
    """Keys of a motor whose speed is a duty cycle.

    Attributes:
        pwm_hz: Frequency of the PWM, Hz; gpiozero supports up to 10 kHz.
        start: Smallest duty that moves the motor, used for values just above 0.
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
        """Conversion between speed and duty."""
        return Duty(self.start, self.full)


class HBridgeKeys(_DutyKeys, frozen=True, kw_only=True):
    """Keys of an H-bridge.

    Attributes:
        forward: Input for forward or right.
        backward: Input for backward or left.
        enable: Input that enables the bridge; -1 for none.
    """

    forward: Pin
    backward: Pin
    enable: OptionalPin = NO_PIN

    def drive(self, duty: Callable[[Pin], float]) -> float:
        """Return the signed duty of the motor from the duties of the pins, -1 to 1."""
        enabled = 1.0 if self.enable == NO_PIN else duty(self.enable)
        return (duty(self.forward) - duty(self.backward)) * enabled


class PhaseEnableKeys(_DutyKeys, frozen=True, kw_only=True):
    """Keys of a driver in phase/enable mode.

    Attributes:
        phase: Input for the direction; high is backward.
        enable: Input for the speed.
    """

    phase: Pin
    enable: Pin

    def drive(self, duty: Callable[[Pin], float]) -> float:
        """Return the signed duty of the motor from the duties of the pins, -1 to 1."""
        # A phase that is high part of the time turns the motor back and forth.
        return duty(self.enable) * (1.0 - 2.0 * duty(self.phase))


class _DutyMotor:
    """Bidirectional motor on two pins; see `OutputDriver`.

    `hz` maps each pin to the frequency of its PWM, Hz, 0 for a plain output. Its last two pins are
    the inputs of the motor; a pin before them enables the motor.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware, hz: Mapping[Pin, int]) -> None:
        from gpiozero import DigitalOutputDevice, PWMOutputDevice  # Simulations do not need them.

        *_, first, second = hz
        self._name = f"Output {plan.name!r} on GPIO{first} and GPIO{second}"
        self._duty = _DutyKeys.of(plan.settings).duty
        self._written: float | None = None
        devices: list[Any] = []
        with device_errors(self._name), ExitStack() as undo:
            factory = hardware.pin_factory()
            for pin, pwm_hz in hz.items():
                if pwm_hz:
                    device = PWMOutputDevice(pin, frequency=pwm_hz, pin_factory=factory)
                else:
                    device = DigitalOutputDevice(pin, pin_factory=factory)
                devices.append(device)
                undo.callback(device.close)
                undo.callback(device.off)  # A plain output would keep its level.
            *self._enables, self._first, self._second = devices
            self.write(0.0, 0)
            undo.callback(self.release)
            self._opened = undo.pop_all()

    def write(self, value: float, now_ns: int) -> float:
        """Write a speed and return the applied one; see `OutputDriver.write`."""
        drive = math.copysign(self._duty.of(value), value)
        if drive != self._written:
            # A failed write may still have taken effect.
            written, self._written = self._written, None
            with device_errors(self._name):
                self._drive(drive, written)
                for enable in self._enables:
                    enable.on()
            self._written = drive
        return math.copysign(self._duty.size_at(abs(drive)), drive) if drive else 0.0

    def release(self) -> None:
        """Disable the bridge if it has an enable input, and set the speed to zero."""
        self._written = None
        with device_errors(self._name), ExitStack() as stack:
            stack.callback(self._drive, 0.0, None)
            for enable in self._enables:
                enable.off()

    def close(self) -> None:
        """Set all inputs low, once; see `LowAtOncePin.close` for the pins afterwards."""
        with device_errors(self._name):
            self._opened.close()

    def _drive(self, drive: float, written: float | None) -> None:
        """Set a signed duty; `written` is the previous one, or None if it is unknown."""
        raise NotImplementedError


class HBridge(_DutyMotor):
    """Motor on an H-bridge with two inputs, such as L298N, DRV8833 or TB6612FNG.

    One input turns the motor forward, the other backward, each with PWM. They are never on
    together: one is turned off before the other is turned on, and on a Pi `LowAtOncePin` makes that
    immediate. Some boards have a third input that enables the bridge. A released motor coasts, but
    an L298N whose enable input is not connected brakes it.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        keys = HBridgeKeys.of(plan.settings)
        enable = {} if keys.enable == NO_PIN else {keys.enable: 0}
        pwm = {keys.forward: keys.pwm_hz, keys.backward: keys.pwm_hz}
        super().__init__(plan, hardware, enable | pwm)

    def _drive(self, drive: float, written: float | None) -> None:
        forward, backward = self._first, self._second
        if drive:
            rests, turns = (backward, forward) if drive > 0.0 else (forward, backward)
            rests.off()
            turns.value = abs(drive)
            return
        with ExitStack() as stack:  # One input goes low even if the other fails.
            stack.callback(backward.off)
            forward.off()


class PhaseEnable(_DutyMotor):
    """Motor on a driver with direction and speed inputs, such as DRV8835 in phase/enable mode.

    The speed is zero while the direction changes, and on a Pi `LowAtOncePin` makes that immediate.
    Such drivers brake when released, and cannot coast.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        keys = PhaseEnableKeys.of(plan.settings)
        super().__init__(plan, hardware, {keys.phase: 0, keys.enable: keys.pwm_hz})

    def _drive(self, drive: float, written: float | None) -> None:
        phase, enable = self._first, self._second
        # Switch off first, except between two speeds in one direction: the motor would stutter.
        if written is None or drive * written <= 0.0:
            enable.off()
            if drive:
                phase.value = drive < 0.0
        if drive:
            enable.value = abs(drive)


def _wired(plan: OutputPlan, rest: float, duty: DutyOf) -> Callable[[Levels], WiredOutput]:
    keys = (HBridgeKeys if plan.driver == "hbridge" else PhaseEnableKeys).of(plan.settings)

    def state(levels: Levels) -> WiredOutput:
        drive = keys.drive(partial(duty, levels))
        value = math.copysign(keys.duty.size_at(abs(drive)), drive)
        return WiredOutput(value, abs(value - rest) <= (0.01 if rest else 0.0))

    return state


_OFF: Final = WiredOutput(0.0, True)
_LIT_ENABLE: Final = ("enable", " enable", 1.0)

HBRIDGE: Final = OutputChip(
    keys=HBridgeKeys,
    open=HBridge,
    wire=_wired,
    unpowered=_OFF,
    lights=(("forward", " forward", 1.0), ("backward", " backward", -1.0), _LIT_ENABLE),
)

PHASE_ENABLE: Final = OutputChip(
    keys=PhaseEnableKeys,
    open=PhaseEnable,
    wire=_wired,
    unpowered=_OFF,
    lights=(_LIT_ENABLE, ("phase", " backward", -1.0)),
)
