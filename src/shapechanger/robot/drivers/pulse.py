"""Pulses for servos and speed controllers: their widths and their sources."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.guard.plan import OutputPlan
from shapechanger.robot.hardware import Hardware

PULSE_KEYS: Final = {
    "servo": ("left_us", "centre_us", "right_us"),
    "esc": ("backward_us", "neutral_us", "forward_us"),
}
"""Settings of each driver that are pulse widths, at -1, 0 and 1."""


@dataclass(frozen=True, slots=True)
class PulseRange:
    """Pulse widths at -1, 0 and 1, with linear interpolation.

    Attributes:
        low_us: Width at -1: left, or backward.
        middle_us: Width at 0: centre, or neutral.
        high_us: Width at 1: right, or forward. Smaller than `low_us` where a servo is mounted the
            other way round.
    """

    low_us: float
    middle_us: float
    high_us: float

    def __post_init__(self) -> None:
        if (self.low_us - self.middle_us) * (self.high_us - self.middle_us) >= 0.0:
            raise RobotError(
                f"A middle of {self.middle_us} us must lie between {self.low_us} us and "
                f"{self.high_us} us."
            )

    @classmethod
    def of(cls, output: OutputPlan) -> PulseRange:
        """Return the pulse widths of a servo or a controller."""
        return cls(*(output.settings[key] for key in PULSE_KEYS[output.driver]))

    def width_us(self, value: float) -> float:
        """Return the width for a value, which is clipped to -1 to 1."""
        end_us = self.high_us if value > 0.0 else self.low_us
        return self.middle_us + (end_us - self.middle_us) * min(abs(value), 1.0)

    def value(self, width_us: float) -> float:
        """Return the value of a width."""
        up = (width_us - self.middle_us) / (self.high_us - self.middle_us)
        if up >= 0.0:
            return up
        return -(width_us - self.middle_us) / (self.low_us - self.middle_us)


class PulseChannel(Protocol):
    """Source of the pulses of one servo."""

    def write_us(self, width_us: float) -> float:
        """Send pulses of this width from now on, and return the applied width."""
        ...

    def release(self) -> None:
        """Stop the pulses."""
        ...

    def close(self) -> None:
        """Stop the pulses and close."""
        ...


def open_pulse_channel(settings: Mapping[str, Any], hardware: Hardware) -> PulseChannel:
    """Open a source of pulses without sending any.

    Args:
        settings: `over` names the source: "pca9685" (with `bus`, `address`, `channel` and
            `output_enable`, a BCM pin or -1), "lgpio" (with `pin`) or "sysfs" (with `chip` and
            `channel`); `hz` is the number of pulses per second.
        hardware: Where the buses and pins are.
    """
    match settings["over"]:
        case "pca9685":
            from shapechanger.robot.drivers.pca9685 import open_channel

            return open_channel(settings, hardware)
        case "lgpio":
            return _PinChannel(settings["pin"], settings["hz"], hardware)
        case _:
            return SysfsPwm(settings["chip"], settings["channel"], settings["hz"])


class _WholeMicroseconds:
    """Channel with pulses of whole microseconds, sent only when they change."""

    def __init__(self) -> None:
        self._width_us: int | None = None

    def write_us(self, width_us: float) -> float:
        """Send pulses of this width; see `PulseChannel.write_us`."""
        self._send(round(width_us))
        return float(round(width_us))

    def release(self) -> None:
        """Stop the pulses; the pin stays low."""
        self._send(0)

    def _send(self, width_us: int) -> None:
        if width_us != self._width_us:
            self._width_us = None  # A failed write may still have taken effect.
            self._pulse(width_us)
            self._width_us = width_us

    def _pulse(self, width_us: int) -> None:
        raise NotImplementedError


class _PinChannel(_WholeMicroseconds):
    """Pulses on a pin; see `ServoPins`."""

    def __init__(self, pin: int, hz: int, hardware: Hardware) -> None:
        super().__init__()
        self._pin = pin
        self._hz = hz
        self._pins = hardware.servo_pins()

    def close(self) -> None:
        try:
            self._send(0)
        finally:
            self._pins.close()

    def _pulse(self, width_us: int) -> None:
        self._pins.pulse(self._pin, width_us, self._hz)


_ROOT: Final = Path("/sys/class/pwm")
_EXPORT_S: Final = 1.0  # udev takes a moment to assign a new channel to the group gpio.


class SysfsPwm(_WholeMicroseconds):
    """One channel of the PWM hardware; see `PulseChannel`.

    Args:
        chip: Number of the PWM chip.
        channel: Channel of the chip.
        hz: Pulses per second.
        root: Folder of the kernel's PWM chips.
    """

    def __init__(self, chip: int, channel: int, hz: int, root: Path = _ROOT) -> None:
        super().__init__()
        self._name = f"Channel {channel} of {root}/pwmchip{chip}"
        self._folder = root / f"pwmchip{chip}" / f"pwm{channel}"
        with device_errors(self._name):
            if not self._folder.exists():
                (self._folder.parent / "export").write_text(f"{channel}\n")
            self._write_when_allowed("period", 1_000_000_000 // hz)
            self._send(0)
            self._write("enable", 1)

    def close(self) -> None:
        """Stop the pulses and disable the channel."""
        with device_errors(self._name):
            try:
                self._send(0)
            finally:
                self._write("enable", 0)

    def _pulse(self, width_us: int) -> None:
        with device_errors(self._name):
            self._write("duty_cycle", width_us * 1000)

    def _write(self, file: str, number: int) -> None:
        (self._folder / file).write_text(f"{number}\n")

    def _write_when_allowed(self, file: str, number: int) -> None:
        deadline = time.monotonic() + _EXPORT_S
        while True:
            try:
                return self._write(file, number)
            except (PermissionError, FileNotFoundError):
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.01)
