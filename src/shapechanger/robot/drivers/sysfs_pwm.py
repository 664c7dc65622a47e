"""Servo pulses by the PWM hardware of the Raspberry Pi, as the kernel offers it in /sys/class/pwm.

It needs `dtoverlay=pwm-2chan` in config.txt. Its files are described in the kernel's documentation,
`Documentation/driver-api/pwm.rst`. The hardware goes on sending when the process dies.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from shapechanger.robot.drivers.in_words import in_words

__all__ = ["SysfsPwm"]

_ROOT: Final = Path("/sys/class/pwm")
_EXPORT_S: Final = 1.0  # udev takes a moment to give a new channel to the group gpio.


class SysfsPwm:
    """One channel of the PWM hardware; see `PulseChannel`."""

    def __init__(self, chip: int, channel: int, hz: int, root: Path = _ROOT) -> None:
        self._name = f"Channel {channel} of {root}/pwmchip{chip}"
        self._folder = root / f"pwmchip{chip}" / f"pwm{channel}"
        self._width_us: int | None = None
        with in_words(self._name):
            if not self._folder.exists():
                (self._folder.parent / "export").write_text(f"{channel}\n")
            self._write_when_allowed("period", 1_000_000_000 // hz)
            self._send(0)
            self._write("enable", 1)

    def write_us(self, width_us: float) -> float:
        """Send pulses of this width; see `PulseChannel.write_us`."""
        with in_words(self._name):
            self._send(round(width_us))
        return float(round(width_us))

    def release(self) -> None:
        """Send none: the pin stays low."""
        with in_words(self._name):
            self._send(0)

    def close(self) -> None:
        """Send none, and switch the channel off."""
        with in_words(self._name):
            try:
                self._send(0)
            finally:
                self._write("enable", 0)

    def _send(self, width_us: int) -> None:
        if width_us != self._width_us:
            self._width_us = None  # What fails may have taken effect all the same.
            self._write("duty_cycle", width_us * 1000)
            self._width_us = width_us

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
