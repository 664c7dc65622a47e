"""The TCA9548A: one I2C bus in front, eight behind, each open or not.

Source: Texas Instruments, TCA9548A data sheet SCPS207F, section 8.5.4.
"""

from __future__ import annotations

import errno
from collections.abc import Mapping, Sequence

from shapechanger.twin.chips.chip import Chip

__all__ = ["Behind", "Tca9548a"]


class Tca9548a:
    """A control register of one byte, whose bits open channels; none is open at power-on.

    Args:
        channels: What is behind each channel, from 0 to 7; all chips have one address there.
    """

    def __init__(self, channels: Mapping[int, Chip]) -> None:
        self.channels = dict(channels)
        self._control = 0

    @property
    def open(self) -> list[Chip]:
        """The chips that hear what is said now."""
        return [chip for channel, chip in self.channels.items() if self._control >> channel & 1]

    def read(self, register: int, length: int) -> list[int]:
        """The control register again and again; to ask for a register is to write it."""
        self._control = register
        return [self._control] * length

    def write(self, register: int, data: Sequence[int]) -> None:
        """The last byte counts, and the one that other chips take for a register is the first."""
        self._control = (register, *data)[-1]


class Behind:
    """What answers behind a multiplexer at the address of its chips.

    Args:
        mux: The multiplexer.
    """

    def __init__(self, mux: Tca9548a) -> None:
        self._mux = mux

    def read(self, register: int, length: int) -> list[int]:
        """Bytes of all chips that hear it: where one pulls the line low, it is low.

        Raises:
            OSError: If no chip hears it, with the number that the kernel's driver gives.
        """
        said = [0xFF] * length
        for chip in self._heard():
            said = [a & b for a, b in zip(said, chip.read(register, length), strict=True)]
        return said

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes to all chips that hear it.

        Raises:
            OSError: If no chip hears it.
        """
        for chip in self._heard():
            chip.write(register, data)

    def _heard(self) -> list[Chip]:
        if not (heard := self._mux.open):
            raise OSError(errno.EREMOTEIO, "no chip answers")
        return heard
