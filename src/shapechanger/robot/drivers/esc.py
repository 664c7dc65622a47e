"""Electronic speed controllers (ESC), driven by servo pulses."""

from __future__ import annotations

from contextlib import ExitStack

from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.drivers.pulse import PulseRange, open_pulse_channel
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware


class Esc:
    """Electronic speed controller; see `OutputDriver`.

    It arms after some time at neutral, until which only neutral is sent. A car's controller brakes
    at the first pulse below neutral and reverses at the second: `reverse` "double" sends brake,
    neutral and reverse in sequence. Pulses at neutral or above are sent at once.

    The settings are those of `open_pulse_channel`, `backward_us`, `neutral_us` and `forward_us` (at
    -1, 0 and 1), `arm_s` (time at neutral before it obeys), `reverse` ("direct", "double" or
    "none") and `brake_ms` (how long "double" brakes, and then waits at neutral).
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        settings = plan.settings
        self._name = f"Output {plan.name!r}"
        self._pulses = PulseRange.of(plan)
        self._reverse: str = settings["reverse"]
        self._arm_ns = round(settings["arm_s"] * 1e9)
        self._brake_ns = round(settings["brake_ms"] / 1e3 * 1e9)
        self._neutral_since_ns: int | None = None
        self._backward_since_ns: int | None = None
        self._reverses = False
        with device_errors(self._name), ExitStack() as undo:
            self._channel = open_pulse_channel(settings, hardware)
            undo.callback(self._channel.close)
            self._send(0.0)
            undo.pop_all()

    def write(self, value: float, now_ns: int) -> float:
        """Write a throttle and return the applied one; see `OutputDriver.write`."""
        if self._neutral_since_ns is None:
            self._neutral_since_ns = now_ns
        if now_ns - self._neutral_since_ns < self._arm_ns:
            return self._send(0.0)
        if value < 0.0:
            return self._backward(value, now_ns)
        self._backward_since_ns = None
        if value > 0.0:
            self._reverses = False  # After forward motion it brakes first.
        return self._send(value)

    def release(self) -> None:
        """Stop the pulses; the controller then has to see neutral again."""
        self._neutral_since_ns = self._backward_since_ns = None
        self._reverses = False
        with device_errors(self._name):
            self._channel.release()

    def close(self) -> None:
        """Stop the pulses and close the channel."""
        with device_errors(self._name):
            self._channel.close()

    def _backward(self, value: float, now_ns: int) -> float:
        if self._reverse == "none":
            return self._send(0.0)
        if self._reverse == "direct" or self._reverses:
            return self._send(value)
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

    def _send(self, value: float) -> float:
        with device_errors(self._name):
            width_us = self._channel.write_us(self._pulses.width_us(value))
        # Neutral reads as 0, even if the pulse steps do not hit it exactly.
        return self._pulses.value(width_us) if value else 0.0
