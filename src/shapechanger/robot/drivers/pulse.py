"""Hobby servos and electronic speed controllers (ESC), and the sources of their pulses."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, ClassVar, Final, Literal, cast

from msgspec import Meta

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import (
    OUTPUTS,
    PULSES,
    Claim,
    KeyMistake,
    Keys,
    OutputChip,
    PulseChannel,
    PulseSource,
    device_errors,
)
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.drivers.simulation import NO_PULSE, DutyOf, Levels, WiredOutput
from shapechanger.robot.hardware import Hardware

Width = Annotated[int, Meta(ge=500, le=2500)]
"""Width of a pulse for a servo or controller, µs, in the range that lgpio.tx_servo accepts."""


class PulsedKeys(Keys, frozen=True, kw_only=True):
    """Keys of an output that is controlled by pulses.

    Attributes:
        over: Source of the pulses.
        hz: Pulses per second; equal for all channels of a chip.
    """

    widths: ClassVar[tuple[str, str, str]]
    """Keys of the widths at -1, 0 and 1; the width at 1 may be smaller than the width at -1."""

    over: str
    hz: Annotated[int, Meta(ge=40, le=400)] = 50

    def __post_init__(self) -> None:
        """Refuse a width at 0 that is not between the others, or a pulse as long as its period."""
        first, middle, last = self._widths_us()
        low, high = sorted((first, last))
        if not low < middle < high:
            ends = f"{self.widths[0]} and {self.widths[2]}, {low} and {high}"
            raise KeyMistake(self.widths[1], f"must lie between {ends}")
        if high * self.hz >= 1_000_000:
            raise KeyMistake("hz", f"leaves no time for a pulse of {high} µs")

    def width_us(self, value: float) -> float:
        """Return the width for a value, which is clipped to -1 to 1."""
        low_us, middle_us, high_us = self._widths_us()
        end_us = high_us if value > 0.0 else low_us
        return middle_us + (end_us - middle_us) * min(abs(value), 1.0)

    def value(self, width_us: float) -> float:
        """Return the value of a width."""
        low_us, middle_us, high_us = self._widths_us()
        up = (width_us - middle_us) / (high_us - middle_us)
        return up if up >= 0.0 else -(width_us - middle_us) / (low_us - middle_us)

    def _widths_us(self) -> tuple[int, int, int]:
        low, middle, high = self.widths
        return getattr(self, low), getattr(self, middle), getattr(self, high)


def pulsed_keys(output: OutputPlan) -> PulsedKeys:
    """Return the keys of a servo or a controller."""
    return cast("PulsedKeys", OUTPUTS[output.driver].keys.of(output.settings))


class _LgpioKeys(Keys, frozen=True, kw_only=True):
    """Pulses directly on a pin.

    Attributes:
        pin: The pin.
    """

    pin: Pin


class _PinChannel(PulseChannel):
    """Pulses on a pin, sent with the pin factory."""

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        self._pin, self._hz = plan.settings["pin"], plan.settings["hz"]
        self._factory = hardware.pin_factory()

    def _pulse(self, width_us: int) -> None:
        self._factory.pulse(self._pin, width_us, self._hz)


def _pulse_us(plan: OutputPlan, duty: DutyOf, levels: Levels) -> float:
    return levels.pulses.get(plan.settings["pin"], NO_PULSE).us


LGPIO: Final = PulseSource(keys=_LgpioKeys, open=_PinChannel, pulse_us=_pulse_us)


_ROOT: Final = Path("/sys/class/pwm")
_EXPORT_S: Final = 1.0  # Longest wait until udev has assigned a new channel to the group gpio, s.


class _SysfsKeys(Keys, frozen=True, kw_only=True):
    """Pulses by the kernel's PWM.

    Attributes:
        chip: Number of the PWM chip.
        channel: Channel of the chip.
    """

    chip: Annotated[int, Meta(ge=0, le=99)] = 0
    channel: Annotated[int, Meta(ge=0, le=15)]

    def claims(self) -> Iterator[Claim]:
        """Return the claim of the channel."""
        yield Claim("channel", f"channel {self.channel} of PWM chip {self.chip}")


class SysfsPwm(PulseChannel):
    """One channel of the PWM hardware."""

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        keys = _SysfsKeys.of(plan.settings)
        chip = _ROOT / f"pwmchip{keys.chip}"
        self._folder = chip / f"pwm{keys.channel}"
        if not self._folder.exists():
            (chip / "export").write_text(f"{keys.channel}\n")
        period_ns, deadline = 1_000_000_000 // plan.settings["hz"], time.monotonic() + _EXPORT_S
        while True:
            try:
                self._write("period", period_ns)
                break
            except (PermissionError, FileNotFoundError):
                if time.monotonic() >= deadline:
                    raise
                time.sleep(0.01)
        self._send(0)
        self._write("enable", 1)

    def close(self) -> None:
        """Stop the pulses and disable the channel."""
        with ExitStack() as stack:
            stack.callback(self._write, "enable", 0)
            self._send(0)

    def _pulse(self, width_us: int) -> None:
        self._write("duty_cycle", width_us * 1000)

    def _write(self, file: str, number: int) -> None:
        (self._folder / file).write_text(f"{number}\n")


SYSFS: Final = PulseSource(keys=_SysfsKeys, open=SysfsPwm)


# Dead band of a speed controller on each side of neutral, µs; makers state 10 to 50.
_DEAD_BAND_US: Final = 20.0

_LIT_PIN: Final = (("pin", ", dimly", 1.0),)


class _PulsedOutput:
    """Output that is controlled by pulses; see `OutputDriver`."""

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        self._name = f"Output {plan.name!r}"
        self._keys = pulsed_keys(plan)
        with device_errors(self._name):
            self._channel = PULSES[plan.settings["over"]].open(plan, hardware)

    def release(self) -> None:
        """Stop the pulses, which releases most servos."""
        with device_errors(self._name):
            self._channel.release()

    def close(self) -> None:
        """Stop the pulses and close the channel."""
        with device_errors(self._name):
            self._channel.close()

    def _send(self, value: float) -> float:
        """Send the pulse of a value, and return the value of the applied pulse."""
        with device_errors(self._name):
            width_us = self._channel.write_us(self._keys.width_us(value))
        return self._keys.value(width_us)


def _wired(plan: OutputPlan, rest: float, duty: DutyOf) -> Callable[[Levels], WiredOutput]:
    """Return a function that reads an output's state from its pulses; see `OutputChip.wire`."""
    keys, stands_still = pulsed_keys(plan), OUTPUTS[plan.driver].drives
    if (pulse_us := PULSES[keys.over].pulse_us) is None:
        has = " and ".join(repr(name) for name, one in PULSES.items() if one.pulse_us)
        over = f"over {keys.over!r}; it has them over {has}"
        raise RobotError(f"Output {plan.name!r}: the twin has no servos {over}.")
    middle_us = keys.width_us(0.0)
    tolerance = _DEAD_BAND_US / abs(keys.width_us(1.0) - middle_us)

    def state(levels: Levels) -> WiredOutput:
        if not (us := pulse_us(plan, duty, levels)):
            return WiredOutput(None, True)
        if stands_still and abs(us - middle_us) <= _DEAD_BAND_US:
            return WiredOutput(0.0, True)
        value = max(-1.0, min(1.0, keys.value(us)))
        return WiredOutput(value, not stands_still and abs(value - rest) <= tolerance)

    return state


_DEG_PER_VALUE: Final = 90.0  # Assumes that a servo turns by 180 degrees from -1 to 1.


class ServoKeys(PulsedKeys, frozen=True, kw_only=True):
    """Keys of a servo.

    Attributes:
        left_us: Pulse width at -1; larger than `right_us` for a servo that turns the other way.
        centre_us: Pulse width at 0.
        right_us: Pulse width at 1.
        travel_deg_per_s: Largest speed, degrees per second; infinite for no limit. A servo is
            assumed to turn by 180 degrees from end to end; if yours turns by 90, double the speed.
    """

    widths: ClassVar = ("left_us", "centre_us", "right_us")
    left_us: Width = 1000
    centre_us: Width = 1500
    right_us: Width = 2000
    travel_deg_per_s: Annotated[float, Meta(gt=0)] = math.inf


class ServoDriver(_PulsedOutput):
    """Servo; see `OutputDriver`. No pulse is sent before the first position."""

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        super().__init__(plan, hardware)
        self._speed_per_s = ServoKeys.of(plan.settings).travel_deg_per_s / _DEG_PER_VALUE
        self._value: float | None = None
        self._written_ns = 0

    def write(self, value: float, now_ns: int) -> float:
        """Move towards a position, limited in speed after the first; see `OutputDriver.write`."""
        value = min(max(value, -1.0), 1.0)
        if self._value is not None and math.isfinite(self._speed_per_s):
            most = self._speed_per_s * (now_ns - self._written_ns) / 1e9
            value = min(max(value, self._value - most), self._value + most)
        applied = self._send(value)
        self._value, self._written_ns = value, now_ns
        return applied

    def release(self) -> None:
        """Stop the pulses; the speed of the next motion is not limited."""
        self._value = None
        super().release()


SERVO: Final = OutputChip(
    keys=ServoKeys,
    open=ServoDriver,
    wire=_wired,
    pulses=ServoKeys.widths,
    lights=_LIT_PIN,
    differs="it turns no faster than its profile allows",
)


class EscKeys(PulsedKeys, frozen=True, kw_only=True):
    """Keys of a speed controller.

    Attributes:
        backward_us: Pulse width at full reverse.
        neutral_us: Pulse width at rest.
        forward_us: Pulse width at full speed.
        arm_s: Time at neutral before the controller obeys, s.
        reverse: "direct" if the controller reverses at once, "double" if it brakes at the first
            pulse backward and reverses at the second, "none" if it cannot reverse.
        brake_ms: With "double": duration of the brake, and of the neutral after it, ms each.
    """

    widths: ClassVar = ("backward_us", "neutral_us", "forward_us")
    backward_us: Width = 1000
    neutral_us: Width = 1500
    forward_us: Width = 2000
    arm_s: Annotated[float, Meta(ge=0, le=30)] = 2.5
    reverse: Literal["direct", "double", "none"] = "direct"
    brake_ms: Annotated[int, Meta(ge=0, le=2000)] = 200


class Esc(_PulsedOutput):
    """Electronic speed controller; see `OutputDriver`.

    A controller arms after some time at neutral; until then, only neutral is sent. A car's
    controller brakes at the first pulse below neutral and reverses at the second, so `reverse`
    "double" sends brake, neutral and reverse in sequence; with "none", backward becomes neutral.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        keys = EscKeys.of(plan.settings)
        super().__init__(plan, hardware)
        self._reverse = keys.reverse
        self._arm_ns, self._brake_ns = round(keys.arm_s * 1e9), keys.brake_ms * 1_000_000
        self._neutral_since_ns: int | None = None
        self._backward_since_ns: int | None = None
        self._reverses = False
        with ExitStack() as undo:
            undo.callback(self._channel.close)
            self._send(0.0)
            undo.pop_all()

    def write(self, value: float, now_ns: int) -> float:
        """Write a throttle and return the applied one; see `OutputDriver.write`."""
        if self._neutral_since_ns is None:
            self._neutral_since_ns = now_ns
        if now_ns - self._neutral_since_ns < self._arm_ns:
            return self._send(0.0)
        if value >= 0.0:
            self._backward_since_ns = None
            self._reverses = self._reverses and value == 0.0  # After driving forward it brakes.
        elif self._reverse == "none":
            return self._send(0.0)
        elif self._reverse == "double" and not self._reverses:
            if self._backward_since_ns is None:
                self._backward_since_ns = now_ns
            since_ns = now_ns - self._backward_since_ns
            if since_ns < self._brake_ns:
                self._send(value)
                return 0.0  # It brakes and does not reverse.
            if since_ns < 2 * self._brake_ns:
                return self._send(0.0)
            self._reverses = True
        return self._send(value)

    def release(self) -> None:
        """Stop the pulses; the controller then has to see neutral again."""
        self._neutral_since_ns = self._backward_since_ns = None
        self._reverses = False
        super().release()

    def _send(self, value: float) -> float:
        # Neutral reads as 0, even if the pulse steps do not hit it exactly.
        applied = super()._send(value)
        return applied if value else 0.0


# Share of `arm_s` after which a simulated controller arms, a little before its driver expects it.
_ARM_SHARE: Final = 0.8


class SpeedController:
    """Hobby speed controller: converts the value of its pulses to the value of the motor.

    With `reverse` "double", the first backward pulses after arming or driving forward brake;
    backward pulses after another neutral drive backward.
    """

    def __init__(self, plan: OutputPlan) -> None:
        keys = EscKeys.of(plan.settings)
        self._reverse = keys.reverse
        self._arm_ns = keys.arm_s * 1e9 * _ARM_SHARE
        self._neutral_since_ns: int | None = None
        self._armed = self._braked = self._reverses = False

    def __call__(self, value: float | None, now_ns: int) -> float:
        """Return the value for the motor, -1 to 1, from the value of the pulses, -1 to 1.

        The value None means no pulses or no power: it then stops, and must see neutral again.
        """
        if value is None:
            self._armed = self._braked = self._reverses = False
        elif value == 0.0:
            if self._neutral_since_ns is None:
                self._neutral_since_ns = now_ns
            self._armed = self._armed or now_ns - self._neutral_since_ns >= self._arm_ns
            self._reverses = self._reverses or self._braked
            return 0.0
        self._neutral_since_ns = None
        if value is None or not self._armed:
            return 0.0
        if value > 0.0:
            self._braked = self._reverses = False
            return value
        if self._reverse == "direct" or (self._reverse == "double" and self._reverses):
            return value
        self._braked = True
        return 0.0


ESC: Final = OutputChip(
    keys=EscKeys,
    open=Esc,
    wire=_wired,
    unpowered=WiredOutput(None, True),
    obeys=SpeedController,
    pulses=EscKeys.widths,
    lights=_LIT_PIN,
    differs="its controller waits, brakes or changes direction",
    drives=True,
)
