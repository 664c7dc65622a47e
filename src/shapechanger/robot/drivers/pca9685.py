"""The PCA9685: sixteen servo pulses over I2C, with a timing of its own.

Registers and formulas: NXP, PCA9685 product data sheet, rev. 4 (2015-04-16), sections 7.3.1 to
7.3.5. A PCA9685 keeps its last pulses for ever when nobody speaks to it; hence the pin for its OE
input.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Final

from gpiozero import DigitalOutputDevice

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.in_words import in_words
from shapechanger.robot.drivers.settings import whole
from shapechanger.robot.hardware import Hardware

__all__ = ["Pca9685", "Pca9685Channel", "open_channel", "prescale_for"]

_MODE1: Final = 0x00
_MODE2: Final = 0x01
_CHANNEL_0: Final = 0x06  # LED0_ON_L; four registers a channel follow: ON_L, ON_H, OFF_L, OFF_H.
_ALL_OFF_H: Final = 0xFD  # ALL_LED_OFF_H.
_PRESCALE: Final = 0xFE

_AUTO_INCREMENT: Final = 0x20  # MODE1, AI.
_SLEEP: Final = 0x10  # MODE1; the prescaler can be written only then.
_TOTEM_POLE: Final = 0x04  # MODE2, OUTDRV; outputs change at the stop of a transfer (OCH = 0).
_FULL_OFF: Final = 0x10  # Bit 4 of OFF_H: no pulse at all.

_OSCILLATOR_MHZ: Final = 25.0  # The internal oscillator; boards deviate, so calibrate the widths.
_STEPS: Final = 4096
_WAKE_UP_S: Final = 0.0005  # 500 us at most until the oscillator is up (section 7.3.1.1).
_PRESCALE_RANGE: Final = (3, 255)

# Unchanged pulses are not written again; now and then the chip is asked whether it still runs,
# because one that lost its power for a moment sleeps.
_WRITES_PER_CHECK: Final = 50


def prescale_for(hz: float) -> int:
    """The value of the prescaler for a frequency: round(25 MHz / (4096 hz)) - 1, section 7.3.5."""
    prescale = round(_OSCILLATOR_MHZ * 1e6 / (_STEPS * hz)) - 1
    low, high = _PRESCALE_RANGE
    if not low <= prescale <= high:
        raise RobotError(f"A PCA9685 sends pulses at 24 to 1526 Hz, not at {hz} Hz.")
    return prescale


class Pca9685:
    """One chip, shared by its channels in this process."""

    def __init__(
        self, hardware: Hardware, bus: int, address: int, hz: int, output_enable: int
    ) -> None:
        self.name = f"The PCA9685 at 0x{address:02x} on I2C bus {bus}"
        self.hz = hz
        self.output_enable = output_enable
        self.channels: set[int] = set()
        self._sending: set[int] = set()
        self._hardware = hardware
        self._address = address
        self._prescale = prescale_for(hz)
        self._enable: DigitalOutputDevice | None = None
        with in_words(self.name):
            if output_enable >= 0:
                # OE is active low, and a resistor pulls it up until we drive it.
                self._enable = DigitalOutputDevice(
                    output_enable, active_high=False, pin_factory=hardware.pin_factory()
                )
            self._bus = hardware.i2c(bus)
            try:
                self._start()
            except OSError:
                self._let_go()
                raise

    def step_us(self) -> float:
        """Width of one step: 4.88 us at 50 Hz."""
        return (self._prescale + 1) / _OSCILLATOR_MHZ

    def send(self, channel: int, steps: int) -> None:
        """Send pulses of so many steps."""
        self._write(channel, [0, 0, steps & 0xFF, steps >> 8])
        self._sending.add(channel)
        if self._enable is not None:
            self._enable.on()

    def stop(self, channel: int) -> None:
        """Send none; without any, the outputs of the chip are off too."""
        self._sending.discard(channel)
        if self._enable is not None and not self._sending:
            self._enable.off()
        self._write(channel, [0, 0, 0, _FULL_OFF])

    def check(self) -> None:
        """Make sure that the chip still runs.

        Raises:
            RobotError: If it does not answer, or sleeps, as after a loss of power.
        """
        with in_words(self.name):
            asleep = self._bus.read_byte_data(self._address, _MODE1) & _SLEEP
        if asleep:
            raise RobotError(f"{self.name} sleeps: it has lost its power for a moment.")

    def leave(self, channel: int) -> None:
        """One channel less; the last one lets go of the chip."""
        self.channels.discard(channel)
        if not self.channels:
            self._let_go()

    def _let_go(self) -> None:
        self._bus.close()
        if self._enable is not None:
            self._enable.close()

    def _start(self) -> None:
        bus, address = self._bus, self._address
        mode = bus.read_byte_data(address, _MODE1)
        if mode & _SLEEP or bus.read_byte_data(address, _PRESCALE) != self._prescale:
            # First no pulses, so that nothing starts again with the oscillator.
            bus.write_byte_data(address, _ALL_OFF_H, _FULL_OFF)
            bus.write_byte_data(address, _MODE1, _AUTO_INCREMENT | _SLEEP)
            bus.write_byte_data(address, _PRESCALE, self._prescale)
        bus.write_byte_data(address, _MODE2, _TOTEM_POLE)
        bus.write_byte_data(address, _MODE1, _AUTO_INCREMENT)
        time.sleep(_WAKE_UP_S)

    def _write(self, channel: int, registers: list[int]) -> None:
        try:
            with in_words(self.name):
                self._bus.write_i2c_block_data(self._address, _CHANNEL_0 + 4 * channel, registers)
        except RobotError:
            # Whatever it was told before, it would go on doing it.
            if self._enable is not None:
                self._enable.off()
            raise


class Pca9685Channel:
    """One of the sixteen; see `PulseChannel`."""

    def __init__(self, chip: Pca9685, channel: int) -> None:
        if not 0 <= channel < 16:
            raise RobotError(f"{chip.name} has channels 0 to 15, not {channel}.")
        if channel in chip.channels:
            raise RobotError(f"Channel {channel} of {chip.name} is used twice.")
        chip.channels.add(channel)
        self._chip: Pca9685 | None = chip
        self._channel = channel
        self._steps: int | None = None
        self._writes = 0

    def write_us(self, width_us: float) -> float:
        """Send pulses of this width, in whole steps; see `PulseChannel.write_us`."""
        chip = self._open_chip()
        steps = min(max(round(width_us / chip.step_us()), 0), _STEPS - 1)
        self._writes += 1
        if steps != self._steps:
            chip.send(self._channel, steps)
            self._steps = steps
        elif self._writes % _WRITES_PER_CHECK == 0:
            chip.check()
        return steps * chip.step_us()

    def release(self) -> None:
        """Send none."""
        self._open_chip().stop(self._channel)
        self._steps = None

    def close(self) -> None:
        """Send none, and let go."""
        if self._chip is not None:
            self.release()
            self._chip.leave(self._channel)
            self._chip = None

    def _open_chip(self) -> Pca9685:
        if self._chip is None:
            raise RobotError(f"Channel {self._channel} of a PCA9685 is closed.")
        return self._chip


# The chips that are open in this process, by hardware, bus and address.
_OPEN: Final[dict[tuple[int, int, int], tuple[Hardware, Pca9685]]] = {}


def open_channel(settings: Mapping[str, object], hardware: Hardware) -> Pca9685Channel:
    """Open a channel; it sends nothing yet.

    Raises:
        RobotError: If the chip does not answer, the channel is used twice, or another channel of
            the chip wants another frequency or enable pin.
    """
    bus, address = whole(settings, "bus"), whole(settings, "address")
    hz, output_enable = whole(settings, "hz"), whole(settings, "output_enable")
    key = (id(hardware), bus, address)
    _, chip = _OPEN.get(key, (hardware, None))
    if chip is None or not chip.channels:
        chip = Pca9685(hardware, bus, address, hz, output_enable)
        _OPEN[key] = (hardware, chip)
    if (chip.hz, chip.output_enable) != (hz, output_enable):
        raise RobotError(
            f"{chip.name} has one frequency and one output_enable for all of its channels, not "
            f"{chip.hz} and {hz} Hz, GPIO{chip.output_enable} and GPIO{output_enable}."
        )
    try:
        channel = Pca9685Channel(chip, whole(settings, "channel"))
        channel.release()
    except RobotError:
        if not chip.channels:
            chip.leave(-1)
        raise
    return channel
