"""The PCA9685: 16 channels of PWM, which go on when everything else has stopped.

Source: NXP, PCA9685 product data sheet, rev. 4, 16 April 2015; its sections are named below.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapechanger.twin.levels import Pulse

__all__ = ["Pca9685"]

_OSCILLATOR_HZ: Final = 25e6  # Section 7.3.5.
_COUNTS: Final = 4096  # Section 7.3.3: a period has so many.
_CHANNELS: Final = 16

_MODE1: Final = 0x00
_FIRST_LED: Final = 0x06
_LAST_LED: Final = 0x45
_FIRST_ALL_LED: Final = 0xFA
_LAST_ALL_LED: Final = 0xFD
_PRESCALE: Final = 0xFE
_LEAST_PRESCALE: Final = 3

_RESTART: Final = 0x80
_AUTO_INCREMENT: Final = 0x20
_SLEEP: Final = 0x10
_FULL: Final = 0x10  # Bit 4 of ON_H and OFF_H: always on, always off. Off wins.


class Pca9685:
    """Registers, and what they make of the channels."""

    def __init__(self) -> None:
        self._registers = bytearray(256)
        # Section 7.3, table 4: as the chip wakes up. It sleeps and all channels are fully off.
        self._registers[_MODE1] = 0x11
        self._registers[0x01] = 0x04
        self._registers[0x02:0x06] = bytes((0xE2, 0xE4, 0xE8, 0xE0))
        for channel in range(_CHANNELS):
            self._registers[_FIRST_LED + 4 * channel + 3] = _FULL
        self._registers[_PRESCALE] = 0x1E
        self._halted: set[int] = set()  # Channels that wait for RESTART after a sleep.

    @property
    def channels(self) -> list[Pulse]:
        """The pulses of all channels; 0 us for a channel that is off."""
        period_s = _COUNTS * (self._registers[_PRESCALE] + 1) / _OSCILLATOR_HZ
        hz = 1.0 / period_s
        return [
            Pulse(self._counts(channel) / _COUNTS * period_s * 1e6, hz)
            for channel in range(_CHANNELS)
        ]

    def read(self, register: int, length: int) -> list[int]:
        """Bytes, from a register on; the same one again and again without auto-increment."""
        return [self._registers[at] for at in self._addressed(register, length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes, from a register on."""
        # Whether it counts on is what MODE1 said when the transfer began.
        for at, byte in zip(self._addressed(register, len(data)), data, strict=True):
            self._write_byte(at, byte)

    def _addressed(self, register: int, length: int) -> list[int]:
        if self._registers[_MODE1] & _AUTO_INCREMENT:
            return [(register + i) % 256 for i in range(length)]
        return [register] * length

    def _write_byte(self, at: int, byte: int) -> None:
        if at == _MODE1:
            self._write_mode1(byte)
        elif at == _PRESCALE:
            if self._registers[_MODE1] & _SLEEP:  # Section 7.3.5: only while it sleeps.
                self._registers[at] = max(byte, _LEAST_PRESCALE)
        elif _FIRST_ALL_LED <= at <= _LAST_ALL_LED:
            for channel in range(_CHANNELS):
                self._registers[_FIRST_LED + 4 * channel + at - _FIRST_ALL_LED] = byte
            self._halted.clear()
        else:
            self._registers[at] = byte
            if _FIRST_LED <= at <= _LAST_LED:
                self._halted.discard((at - _FIRST_LED) // 4)

    def _write_mode1(self, byte: int) -> None:
        before = self._registers[_MODE1]
        after = byte & ~_RESTART
        if byte & _SLEEP and not before & _SLEEP:
            # Section 7.3.1.1: channels that were on stop until RESTART is written as 1.
            self._halted = {c for c in range(_CHANNELS) if self._counts(c)}
        if byte & _RESTART and not byte & _SLEEP:
            self._halted.clear()
        if self._halted:
            after |= _RESTART
        self._registers[_MODE1] = after

    def _counts(self, channel: int) -> int:
        """For how many of the counts of a period a channel is on."""
        if self._registers[_MODE1] & _SLEEP or channel in self._halted:
            return 0
        at = _FIRST_LED + 4 * channel
        on_low, on_high, off_low, off_high = self._registers[at : at + 4]
        if off_high & _FULL:
            return 0
        if on_high & _FULL:
            return _COUNTS
        on = (on_high & 0x0F) << 8 | on_low
        off = (off_high & 0x0F) << 8 | off_low
        return (off - on) % _COUNTS
