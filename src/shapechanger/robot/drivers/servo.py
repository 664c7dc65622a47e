"""Hobby servos: one position per pulse width."""

from __future__ import annotations

import math
from typing import Final

from shapechanger.robot.drivers.pulse import PulseChannel, PulseRange, open_pulse_channel
from shapechanger.robot.drivers.settings import in_words, number
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

_DEG_PER_VALUE: Final = 90.0  # Assumed travel from end to end, a value of 2: 180 degrees.


class ServoDriver:
    """Servo; see `OutputDriver`. It gets no pulse before the first position."""

    def __init__(
        self, channel: PulseChannel, pulses: PulseRange, speed_per_s: float, name: str
    ) -> None:
        self._channel = channel
        self._pulses = pulses
        self._speed_per_s = speed_per_s
        self._name = name
        self._value: float | None = None
        self._written_ns = 0

    def write(self, value: float, now_ns: int) -> float:
        """Move towards a position at the permitted speed; see `OutputDriver.write`."""
        value = min(max(value, -1.0), 1.0)
        if self._value is not None and math.isfinite(self._speed_per_s):
            most = self._speed_per_s * (now_ns - self._written_ns) / 1e9
            value = min(max(value, self._value - most), self._value + most)
        with in_words(self._name):
            width_us = self._channel.write_us(self._pulses.width_us(value))
        self._value, self._written_ns = value, now_ns
        return self._pulses.value(width_us)

    def release(self) -> None:
        """Stop the pulses, which releases most servos."""
        self._value = None
        with in_words(self._name):
            self._channel.release()

    def close(self) -> None:
        """Stop the pulses and close the channel."""
        with in_words(self._name):
            self._channel.close()


def open_driver(plan: OutputPlan, hardware: Hardware) -> ServoDriver:
    """Open the servo without pulses.

    The settings are those of `open_pulse_channel`, `left_us`, `centre_us` and `right_us` (at -1, 0
    and 1), and `travel_deg_per_s`: how fast it is moved, at most; infinite for as fast as it can.
    From end to end it is taken to turn by 180 degrees; for one that turns by 90, double the speed.
    """
    settings = plan.settings
    name = f"Output {plan.name!r}"
    pulses = PulseRange(*(number(settings, key) for key in ("left_us", "centre_us", "right_us")))
    speed_per_s = number(settings, "travel_deg_per_s") / _DEG_PER_VALUE
    with in_words(name):
        channel = open_pulse_channel(settings, hardware)
    return ServoDriver(channel, pulses, speed_per_s, name)
