"""Electronic speed controllers (ESC), driven by servo pulses."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Annotated, ClassVar, Final, Literal

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


class EscKeys(PulsedKeys, frozen=True, kw_only=True):
    """Keys of a speed controller.

    Attributes:
        backward_us: Pulse width at full reverse.
        neutral_us: Pulse width at rest.
        forward_us: Pulse width at full speed.
        arm_s: Time at neutral before it obeys, s.
        reverse: "double" for one that brakes at the first pulse backward and reverses at the
            second, "none" for one without reverse.
        brake_ms: How long "double" brakes, and then waits at neutral, ms.
    """

    widths: ClassVar = ("backward_us", "neutral_us", "forward_us")
    backward_us: Width = 1000
    neutral_us: Width = 1500
    forward_us: Width = 2000
    arm_s: Annotated[float, Meta(ge=0, le=30)] = 2.5
    reverse: Literal["direct", "double", "none"] = "direct"
    brake_ms: Annotated[int, Meta(ge=0, le=2000)] = 200


class Esc:
    """Electronic speed controller; see `OutputDriver`.

    It arms after some time at neutral, until which only neutral is sent. A car's controller brakes
    at the first pulse below neutral and reverses at the second: `reverse` "double" sends brake,
    neutral and reverse in sequence. Pulses at neutral or above are sent at once.
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


def _wired(plan: OutputPlan, rest: float, duty: DutyOf) -> Callable[[Levels], WiredOutput]:
    pulses, pulse_us = PulseRange.of(plan), wired_pulse(plan, duty)

    def state(levels: Levels) -> WiredOutput:
        us = pulse_us(levels)
        if not us:
            return WiredOutput(None, True)
        if abs(us - pulses.middle_us) <= DEAD_BAND_US:
            return WiredOutput(0.0, True)
        return WiredOutput(max(-1.0, min(1.0, pulses.value(us))), False)

    return state


# A controller arms a little earlier than its driver expects.
_ARM_SHARE: Final = 0.8


class SpeedController:
    """Hobby speed controller: turns the value of its pulses into the motor's.

    With `reverse` "double" the first backward pulses after driving forward brake; only those after
    another neutral drive backward.

    Args:
        plan: Its output.
    """

    def __init__(self, plan: OutputPlan) -> None:
        self._reverse = plan.settings["reverse"]
        self._arm_ns = plan.settings["arm_s"] * 1e9 * _ARM_SHARE
        self._neutral_since_ns: int | None = None
        self._armed = False
        self._braked = False
        self._reverses = False

    def obey(self, value: float | None, now_ns: int) -> float:
        """Return the value for the motor, -1 to 1.

        Args:
            value: Value of the pulses, -1 to 1; None without pulses or power, when it stops and
                must see neutral again.
            now_ns: Time, ns.
        """
        if value is None:
            self._neutral_since_ns = None
            self._armed = self._braked = self._reverses = False
            return 0.0
        if value == 0.0:
            if self._neutral_since_ns is None:
                self._neutral_since_ns = now_ns
            self._armed = self._armed or now_ns - self._neutral_since_ns >= self._arm_ns
            self._reverses = self._reverses or self._braked
            return 0.0
        self._neutral_since_ns = None
        if not self._armed:
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
    obeys=lambda plan: SpeedController(plan).obey,
    pulses=EscKeys.widths,
    differs="its controller waits, brakes or changes direction",
    drives=True,
)
"""A hobby speed controller."""
