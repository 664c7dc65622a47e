"""Pulses for servos and speed controllers: their widths and their sources."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final

from msgspec import Meta

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, PulseChannel, PulseSource
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.drivers.keys import Claim, KeyMistake, Keys
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.drivers.simulation import DutyOf, Levels, Pulse
from shapechanger.robot.hardware import Hardware

_SECOND_US: Final = 1_000_000

Width = Annotated[int, Meta(ge=500, le=2500)]
"""Width of a pulse, µs, that lgpio.tx_servo accepts; servos and controllers use no others."""


class PulsedKeys(Keys, frozen=True, kw_only=True):
    """Keys of an output that takes pulses.

    Attributes:
        over: Source of the pulses.
        hz: Pulses per second; equal for all channels of a chip.
    """

    widths: ClassVar[tuple[str, str, str]]
    """Keys of the widths at -1, 0 and 1."""

    over: str
    hz: Annotated[int, Meta(ge=40, le=400)] = 50

    def __post_init__(self) -> None:
        """Refuse an empty range of pulses, or a pulse that is longer than its period."""
        first, middle, last = (getattr(self, key) for key in self.widths)
        low, high = sorted((first, last))
        if not low < middle < high:
            ends = f"{self.widths[0]} and {self.widths[2]}, {low} and {high}"
            raise KeyMistake(self.widths[1], f"must lie between {ends}")
        if high * self.hz >= _SECOND_US:
            raise KeyMistake("hz", f"leaves no time for a pulse of {high} µs")


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
        return cls(*(output.settings[key] for key in OUTPUTS[output.driver].pulses))

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


DEAD_BAND_US: Final = 20.0
"""Dead band of a speed controller on each side of neutral; makers state 10 to 50."""


def wired_pulse(plan: OutputPlan, duty: DutyOf) -> Callable[[Levels], float]:
    """Return a reader of the width of an output's pulses on a twin, µs; 0 for no pulse."""
    over = plan.settings["over"]
    pulse_of = PULSES[over].pulse_of
    if pulse_of is None:
        has = " and ".join(repr(name) for name, one in PULSES.items() if one.pulse_of)
        raise RobotError(
            f"Output {plan.name!r}: the twin has no servos over {over!r}; it has them over {has}."
        )
    return pulse_of(plan.settings, duty)


def open_pulse_channel(settings: Mapping[str, Any], hardware: Hardware) -> PulseChannel:
    """Open the source of pulses of an output, without sending any."""
    return PULSES[settings["over"]].open(settings, hardware)


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


class _LgpioKeys(Keys, frozen=True, kw_only=True):
    """Pulses directly on a pin.

    Attributes:
        pin: The pin.
    """

    pin: Pin


def _pulse_on_pin(settings: Mapping[str, Any], duty: DutyOf) -> Callable[[Levels], float]:
    pin = settings["pin"]
    return lambda levels: levels.pulses.get(pin, Pulse(0.0, 0.0)).us


LGPIO: Final = PulseSource(
    keys=_LgpioKeys,
    open=lambda settings, hardware: _PinChannel(settings["pin"], settings["hz"], hardware),
    pulse_of=_pulse_on_pin,
)
"""Pulses on a pin, by lgpio."""


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


SYSFS: Final = PulseSource(
    keys=_SysfsKeys,
    open=lambda settings, _: SysfsPwm(settings["chip"], settings["channel"], settings["hz"]),
)
"""Pulses of the kernel's PWM."""
