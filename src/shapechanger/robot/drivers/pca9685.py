"""PCA9685: sixteen servo channels over I2C with hardware timing.

Registers and formulas: NXP, PCA9685 product data sheet, rev. 4 (2015-04-16), sections 7.3.1 to
7.3.5. Without commands, a PCA9685 repeats its last pulses indefinitely, so a profile may name a pin
at its OE input, which disables them.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Annotated, Any, Final
from weakref import WeakValueDictionary

from msgspec import Meta

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import (
    Claim,
    I2cDevice,
    I2cKeys,
    PulseChannel,
    PulseSource,
    device_errors,
    i2c_claims,
)
from shapechanger.robot.drivers.pins import NO_PIN, OptionalPin
from shapechanger.robot.drivers.simulation import (
    NO_PULSE,
    DutyOf,
    Levels,
    Pulse,
    PwmChannel,
    SimulatedChip,
)
from shapechanger.robot.hardware import Hardware

_MODE1: Final = 0x00
_MODE2: Final = 0x01
_CHANNEL_0: Final = 0x06  # LED0_ON_L; four registers a channel follow: ON_L, ON_H, OFF_L, OFF_H.
_ALL_OFF_H: Final = 0xFD  # ALL_LED_OFF_H.
_PRESCALE: Final = 0xFE

_AUTO_INCREMENT: Final = 0x20  # MODE1, AI.
_SLEEP: Final = 0x10  # MODE1; the prescaler can be written only while this bit is set.
_TOTEM_POLE: Final = 0x04  # MODE2, OUTDRV; outputs change at the stop of a transfer (OCH = 0).

_OSCILLATOR_MHZ: Final = 25.0  # Internal oscillator; boards deviate, so calibrate the widths.
_STEPS: Final = 4096
_FULL: Final = 0x1000  # Bit 4 of ON_H and OFF_H: always on, always off. Off wins.
_WAKE_UP_S: Final = 0.0005  # 500 us at most until the oscillator is up (section 7.3.1.1).

# Unchanged pulses are not rewritten. After so many of them the chip is polled, because it sleeps
# after a short loss of power.
_UNCHANGED_PER_CHECK: Final = 50


class Pca9685Keys(I2cKeys, frozen=True, kw_only=True):
    """Keys of a channel of a PCA9685.

    Attributes:
        bus: I2C bus.
        address: Address of the board.
        channel: Channel of the board.
        output_enable: Pin at the board's OE input, active low, with a pull-up; given for one
            output, it applies to the board. -1 for none.
    """

    address: Annotated[int, Meta(ge=0x40, le=0x7F)] = 0x40
    channel: Annotated[int, Meta(ge=0, le=15)]
    output_enable: OptionalPin = NO_PIN

    def claims(self) -> Iterator[Claim]:
        """Return the claims of the channel, and the claims that all channels of the board share."""
        board = f"the PCA9685 at {self.address:#x} of I2C bus {self.bus}"
        yield Claim("channel", f"channel {self.channel} of {board}")
        yield from i2c_claims(self.bus, "address", self.address, board)
        if self.output_enable != NO_PIN:
            yield Claim("output_enable", f"GPIO{self.output_enable}", board)


class Pca9685(I2cDevice):
    """One chip, shared by its channels within the process.

    The state of each channel is cached, so that unchanged widths are not sent again. A failed
    transfer may have taken partial effect, so after one the state of all channels is unknown, and
    the outputs are disabled, if there is a pin for it, until all channels have been rewritten.
    """

    def __init__(self, keys: Pca9685Keys, hz: int, hardware: Hardware) -> None:
        super().__init__("The PCA9685", keys, hardware)
        self.hz = hz
        self.output_enable = keys.output_enable
        # Width of each open channel's pulses, steps of 1/4096 of the period; None if unknown.
        self.steps: dict[int, int | None] = {}
        self._clock = hardware.clock
        self._prescale = round(_OSCILLATOR_MHZ * 1e6 / (_STEPS * hz)) - 1  # Section 7.3.5.
        self.step_us = (self._prescale + 1) / _OSCILLATOR_MHZ  # 4.88 µs at 50 Hz.
        self._must_start = False
        self._unchanged = 0
        self._enable: Any = None
        with device_errors(self.name), ExitStack() as undo:
            undo.callback(self.close)
            if keys.output_enable != NO_PIN:
                from gpiozero import DigitalOutputDevice  # Only needed with such a pin.

                # OE is active low, and a resistor pulls it up until the pin is an output.
                self._enable = DigitalOutputDevice(
                    keys.output_enable, active_high=False, pin_factory=hardware.pin_factory()
                )
                undo.callback(self._enable.close)
            self._start()
            if self._enable is not None:
                # Pulses left by a dead process must not return with the first pulse.
                self.write_registers(_ALL_OFF_H, _FULL >> 8)
            self._opened = undo.pop_all()

    def send(self, channel: int, steps: int) -> None:
        """Send pulses of a width in steps."""
        if self.steps[channel] != steps:
            self._write(channel, steps)
            return
        self._unchanged += 1
        if self._unchanged >= _UNCHANGED_PER_CHECK:
            self._unchanged = 0
            with self._doubt_on_failure():
                if self.read_registers(_MODE1)[0] & _SLEEP:
                    raise RobotError(f"{self.name} is asleep: it lost power for a moment.")

    def stop(self, channel: int) -> None:
        """Stop the pulses of a channel; if no other sends pulses, disable the outputs first."""
        self.steps[channel] = None
        with ExitStack() as stack:
            stack.callback(self._write, channel, _FULL)
            if not self._sends():
                self._switch(False)  # Before `_write`: a hanging bus takes a second to fail.

    def leave(self, channel: int) -> None:
        """Remove a channel; removing the last one closes the chip."""
        self.steps.pop(channel, None)
        if not self.steps:
            self._opened.close()

    def _start(self) -> None:
        (mode,), (prescale,) = self.read_registers(_MODE1), self.read_registers(_PRESCALE)
        asleep = mode & _SLEEP or prescale != self._prescale
        if asleep:
            # Pulses are turned off first, so that none restart with the oscillator.
            self.write_registers(_ALL_OFF_H, _FULL >> 8)
            self.write_registers(_MODE1, _AUTO_INCREMENT | _SLEEP)
            self.write_registers(_PRESCALE, self._prescale)
        self.write_registers(_MODE2, _TOTEM_POLE)
        self.write_registers(_MODE1, _AUTO_INCREMENT)
        if asleep and self._clock.is_real:
            time.sleep(_WAKE_UP_S)
        self._must_start = False

    def _write(self, channel: int, steps: int) -> None:
        with self._doubt_on_failure():
            if self._must_start:
                self._start()
            self.write_registers(_CHANNEL_0 + 4 * channel, 0, 0, steps & 0xFF, steps >> 8)
            self.steps[channel] = steps
            self._switch(self._sends() and None not in self.steps.values())

    def _sends(self) -> bool:
        return any(steps not in (None, _FULL) for steps in self.steps.values())

    def _switch(self, on: bool) -> None:
        if self._enable is not None:
            with device_errors(self.name):
                self._enable.value = on

    @contextmanager
    def _doubt_on_failure(self) -> Generator[None]:
        with ExitStack() as failed:
            failed.callback(self._switch, False)
            failed.callback(setattr, self, "_must_start", True)
            failed.callback(self.steps.update, dict.fromkeys(self.steps))
            yield
            failed.pop_all()


# Open chips of this process, keyed by hardware, bus and address.
_OPEN: Final = WeakValueDictionary[tuple[Hardware, int, int], Pca9685]()


class Pca9685Channel(PulseChannel):
    """One channel, opened without pulses."""

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        keys, hz = Pca9685Keys.of(plan.settings), plan.settings["hz"]
        place = (hardware, keys.bus, keys.address)
        chip = _OPEN.get(place)
        if chip is None or not chip.steps:
            chip = _OPEN[place] = Pca9685(keys, hz, hardware)
        if (chip.hz, chip.output_enable) != (hz, keys.output_enable):
            raise RobotError(
                f"{chip.name} has one frequency and one output_enable for all of its channels, not "
                f"{chip.hz} and {hz} Hz, GPIO{chip.output_enable} and GPIO{keys.output_enable}."
            )
        if keys.channel in chip.steps:
            raise RobotError(f"Channel {keys.channel} of {chip.name} is used twice.")
        self._chip, self._channel = chip, keys.channel
        with ExitStack() as undo:
            undo.callback(chip.leave, keys.channel)  # A retry finds the channel free.
            self.release()
            undo.callback(self.release)
            self._opened = undo.pop_all()

    def write_us(self, width_us: float) -> float:
        """Send pulses of this width, rounded to steps, and return the applied width."""
        step_us = self._chip.step_us
        steps = min(max(round(width_us / step_us), 0), _STEPS - 1)
        self._chip.send(self._channel, steps)
        return steps * step_us

    def release(self) -> None:
        """Stop the pulses."""
        self._chip.stop(self._channel)

    def close(self) -> None:
        """Stop the pulses and close, even if the chip does not respond."""
        self._opened.close()


_CHANNELS: Final = 16
_END: Final = _CHANNEL_0 + 4 * _CHANNELS
_FIRST_ALL_LED: Final = 0xFA


class SimulatedPca9685(SimulatedChip):
    """PCA9685: 16 PWM channels, which continue when the process that set them has ended.

    Unlike on the real chip, channels that were on before a sleep continue without a RESTART.
    """

    def __init__(self) -> None:
        self._registers = bytearray(256)
        # Section 7.3, table 4: after power-on it sleeps, with all channels fully off.
        self._registers[_MODE1] = 0x11
        self._registers[0x01:0x06] = bytes((0x04, 0xE2, 0xE4, 0xE8, 0xE0))
        self._registers[_CHANNEL_0 + 3 : _END : 4] = bytes([_FULL >> 8]) * _CHANNELS
        self._registers[_PRESCALE] = 0x1E

    @property
    def pulses(self) -> list[Pulse]:
        """Pulses of all channels; 0 us for a channel that is off."""
        period_s = _STEPS * (self._registers[_PRESCALE] + 1) / (_OSCILLATOR_MHZ * 1e6)
        pulses: list[Pulse] = []
        for on, off in struct.iter_unpack("<2H", self._registers[_CHANNEL_0:_END]):
            counts = _STEPS if on & _FULL else (off - on) % _STEPS
            if off & _FULL or self._registers[_MODE1] & _SLEEP:
                counts = 0
            pulses.append(Pulse(counts / _STEPS * period_s * 1e6, 1.0 / period_s))
        return pulses

    def read(self, register: int, length: int) -> list[int]:
        """Read bytes from a register on; without auto-increment, that register repeatedly."""
        return [self._registers[at] for at in self._addressed(register, length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes from a register on; without auto-increment all to that register."""
        # Auto-increment is taken from MODE1 at the start of the transfer.
        for at, byte in zip(self._addressed(register, len(data)), data, strict=True):
            if _FIRST_ALL_LED <= at <= _ALL_OFF_H:
                first = _CHANNEL_0 + at - _FIRST_ALL_LED
                self._registers[first:_END:4] = bytes([byte]) * _CHANNELS
            # Section 7.3.5: the prescaler is written only while it sleeps.
            elif at != _PRESCALE or self._registers[_MODE1] & _SLEEP:
                self._registers[at] = byte

    def _addressed(self, register: int, length: int) -> list[int]:
        step = int(bool(self._registers[_MODE1] & _AUTO_INCREMENT))
        return [(register + step * i) % 256 for i in range(length)]


def _pulse_us(plan: OutputPlan, duty: DutyOf, levels: Levels) -> float:
    keys = Pca9685Keys.of(plan.settings)
    if keys.output_enable != NO_PIN and duty(levels, keys.output_enable) > 0.0:
        return 0.0
    return levels.channels.get(PwmChannel(keys.bus, keys.address, keys.channel), NO_PULSE).us


PCA9685: Final = PulseSource(
    keys=Pca9685Keys,
    open=Pca9685Channel,
    pulse_us=_pulse_us,
    chips=lambda plan: {(plan.settings["bus"], plan.settings["address"]): SimulatedPca9685()},
)
