"""Hobby servos: one position per pulse width."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, ClassVar, Final

from msgspec import Meta

from shapechanger.contract.plan import OutputPlan
from shapechanger.robot.drivers.chip import OutputChip
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.drivers.pulse import (
    DEAD_BAND_US,
    PulsedKeys,
    PulseRange,
    Width,
    open_pulse_channel,
    wired_pulse,
)
from shapechanger.robot.drivers.simulation import DutyOf, Levels, WiredOutput
from shapechanger.robot.hardware import Hardware

_DEG_PER_VALUE: Final = 90.0  # Assumed travel from end to end, a value of 2: 180 degrees.


class ServoKeys(PulsedKeys, frozen=True, kw_only=True):
    """Keys of a servo.

    Attributes:
        left_us: Pulse width at -1; larger than `right_us` for one that turns the other way.
        centre_us: Pulse width at 0.
        right_us: Pulse width at 1.
        travel_deg_per_s: Largest speed; infinite for no limit. A servo is assumed to turn by 180
            degrees from end to end; for one that turns by 90, double the speed.
    """

    widths: ClassVar = ("left_us", "centre_us", "right_us")
    left_us: Width = 1000
    centre_us: Width = 1500
    right_us: Width = 2000
    travel_deg_per_s: Annotated[float, Meta(gt=0)] = math.inf


class ServoDriver:
    """Servo; see `OutputDriver`. It gets no pulse before the first position."""

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        self._name = f"Output {plan.name!r}"
        self._pulses = PulseRange.of(plan)
        self._speed_per_s: float = plan.settings["travel_deg_per_s"] / _DEG_PER_VALUE
        self._value: float | None = None
        self._written_ns = 0
        with device_errors(self._name):
            self._channel = open_pulse_channel(plan.settings, hardware)

    def write(self, value: float, now_ns: int) -> float:
        """Move towards a position at the permitted speed; see `OutputDriver.write`."""
        value = min(max(value, -1.0), 1.0)
        if self._value is not None and math.isfinite(self._speed_per_s):
            most = self._speed_per_s * (now_ns - self._written_ns) / 1e9
            value = min(max(value, self._value - most), self._value + most)
        with device_errors(self._name):
            width_us = self._channel.write_us(self._pulses.width_us(value))
        self._value, self._written_ns = value, now_ns
        return self._pulses.value(width_us)

    def release(self) -> None:
        """Stop the pulses, which releases most servos."""
        self._value = None
        with device_errors(self._name):
            self._channel.release()

    def close(self) -> None:
        """Stop the pulses and close the channel."""
        with device_errors(self._name):
            self._channel.close()


def _wired(plan: OutputPlan, rest: float, duty: DutyOf) -> Callable[[Levels], WiredOutput]:
    pulses, pulse_us = PulseRange.of(plan), wired_pulse(plan, duty)
    tolerance = DEAD_BAND_US / abs(pulses.high_us - pulses.middle_us)

    def state(levels: Levels) -> WiredOutput:
        if not (us := pulse_us(levels)):
            return WiredOutput(None, True)
        value = max(-1.0, min(1.0, pulses.value(us)))
        return WiredOutput(value, abs(value - rest) <= tolerance)

    return state


SERVO: Final = OutputChip(
    keys=ServoKeys,
    open=ServoDriver,
    wire=_wired,
    pulses=ServoKeys.widths,
    differs="it turns no faster than its profile allows",
)
"""A hobby servo."""
