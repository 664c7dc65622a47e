"""The INA219: voltage and current of the battery.

Source: Texas Instruments, INA219 data sheet SBOS448G, section 8.6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from shapechanger.worlds.world import Readings

__all__ = ["Ina219"]

_CONFIGURATION: Final = 0
_SHUNT_VOLTAGE: Final = 1
_BUS_VOLTAGE: Final = 2
_POWER: Final = 3
_CURRENT: Final = 4
_CALIBRATION: Final = 5
_RESET: Final = 0x8000
_AT_POWER_ON: Final = 0x399F

_SHUNT_OHM: Final = 0.1  # On the usual breakout boards.
_SHUNT_LSB_V: Final = 10e-6
_BUS_LSB_V: Final = 4e-3
_CONVERSION_READY: Final = 0x2


class Ina219:
    """Registers of 16 bits that are answered from the world.

    Args:
        readings: What the world shows now.
    """

    def __init__(self, readings: Callable[[], Readings]) -> None:
        self._readings = readings
        self._configuration = _AT_POWER_ON
        self._calibration = 0

    def read(self, register: int, length: int) -> list[int]:
        """Bytes of one register; it does not count on."""
        word = self._word(register).to_bytes(2, "big")
        return [word[i % 2] for i in range(length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write a register of 16 bits."""
        if len(data) != 2:
            return  # The chip takes a register only as a whole.
        word = data[0] << 8 | data[1]
        if register == _CONFIGURATION:
            self._configuration = _AT_POWER_ON if word & _RESET else word
        elif register == _CALIBRATION:
            self._calibration = word & 0xFFFE

    def _word(self, register: int) -> int:
        seen = self._readings()
        shunt = round(min(0.32, seen.current_a * _SHUNT_OHM) / _SHUNT_LSB_V)
        bus = round(seen.battery_v / _BUS_LSB_V)
        current = shunt * self._calibration // 4096
        match register:
            case 0:
                return self._configuration
            case 1:
                return shunt & 0xFFFF
            case 2:
                return min(bus, 0x1FFF) << 3 | _CONVERSION_READY
            case 3:
                return current * bus // 5000 & 0xFFFF
            case 4:
                return current & 0xFFFF
            case 5:
                return self._calibration
            case _:
                return 0
