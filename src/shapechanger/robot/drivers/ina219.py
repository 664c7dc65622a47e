"""Voltage sensor INA219 over I2C.

Registers: Texas Instruments, INA219 data sheet, SBOS448G, section 8.6.
"""

from __future__ import annotations

from typing import Final

from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware

_CONFIGURATION: Final = 0x00
_BUS_VOLTAGE: Final = 0x02
_CONTINUOUS_32_V: Final = (0x39, 0x9F)  # The value at power-up: 0x399F.
_V_PER_STEP: Final = 0.004
_STATUS_BITS: Final = 3  # Below the voltage: two flags and one unused bit.
_PERIOD_NS: Final = 100_000_000  # A battery changes slowly, and the bus is shared.


class Ina219:
    """Voltage sensor; see `SensorDriver`. Its settings are `bus` and `address`."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        bus, self._address = plan.settings["bus"], plan.settings["address"]
        self._name = f"Sensor {plan.name!r} at 0x{self._address:02x} on I2C bus {bus}"
        self._read_ns: int | None = None
        self._volts = 0.0
        with device_errors(self._name):
            self._bus = hardware.i2c(bus)
            self._bus.write_i2c_block_data(self._address, _CONFIGURATION, _CONTINUOUS_32_V)

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the voltage of the "battery" in V, updated ten times a second."""
        if self._read_ns is None or now_ns - self._read_ns >= _PERIOD_NS:
            with device_errors(self._name):
                high, low = self._bus.read_i2c_block_data(self._address, _BUS_VOLTAGE, 2)
            self._volts = ((high << 8 | low) >> _STATUS_BITS) * _V_PER_STEP
            self._read_ns = now_ns
        return {"battery": self._volts}

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()
