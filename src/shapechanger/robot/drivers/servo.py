"""Hobby servos: one position per pulse width."""

from __future__ import annotations

import math
from typing import Final

from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.drivers.pulse import PulseRange, open_pulse_channel
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

_DEG_PER_VALUE: Final = 90.0  # Assumed travel from end to end, a value of 2: 180 degrees.


class ServoDriver:
    """Servo; see `OutputDriver`. It gets no pulse before the first position.

    The settings are those of `open_pulse_channel`, `left_us`, `centre_us` and `right_us` (at -1, 0
    and 1), and `travel_deg_per_s`, the largest speed; infinite for no limit. A servo is assumed to
    turn by 180 degrees from end to end; for one that turns by 90, double the speed.
    """

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
