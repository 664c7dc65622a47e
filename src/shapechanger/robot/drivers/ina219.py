"""Voltage sensor INA219 over I2C.

Registers: Texas Instruments, INA219 data sheet, SBOS448G, section 8.6.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.robot.drivers.chip import I2cDevice, I2cKeys, SensorChip, simulated_at_address
from shapechanger.robot.drivers.simulation import SimulatedChip
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # Only simulations need these.
    from shapechanger.contract.world import World

_CONFIGURATION: Final = 0x00
_BUS_VOLTAGE: Final = 0x02
_CONTINUOUS_32_V: Final = 0x399F  # Also the value at power-on.
_CONVERSION_READY: Final = 0x2  # Bit of the bus voltage.
_V_PER_STEP: Final = 0.004
_STATUS_BITS: Final = 3  # Below the voltage: two flags and one unused bit.
_PERIOD_NS: Final = 100_000_000  # A battery changes slowly, and the bus is shared.


class Ina219Keys(I2cKeys, frozen=True, kw_only=True):
    """Keys of an INA219. A PCA9685 has the same default address: change one by a solder bridge."""

    address: Annotated[int, Meta(ge=0x40, le=0x4F)] = 0x40


class Ina219(I2cDevice):
    """Voltage sensor; see `SensorDriver`."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        super().__init__(f"Sensor {plan.name!r}", Ina219Keys.of(plan.settings), hardware)
        self._read_ns: int | None = None
        self._volts = 0.0
        self.write_registers(_CONFIGURATION, *_CONTINUOUS_32_V.to_bytes(2))

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the voltage of the "battery" in V, updated at most ten times a second."""
        if self._read_ns is None or now_ns - self._read_ns >= _PERIOD_NS:
            word = int.from_bytes(self.read_registers(_BUS_VOLTAGE, 2))
            self._volts = (word >> _STATUS_BITS) * _V_PER_STEP
            self._read_ns = now_ns
        return {"battery": self._volts}


class SimulatedIna219(SimulatedChip):
    """INA219: voltage of the battery, in a register of 16 bits; only this register is simulated."""

    def __init__(self, world: World) -> None:
        self._world = world

    def read(self, register: int, length: int) -> list[int]:
        """Read one register; its two bytes repeat."""
        word = 0
        if register == _BUS_VOLTAGE:
            steps = round(self._world.inputs().battery_v / _V_PER_STEP)
            word = min(steps, 0x1FFF) << _STATUS_BITS | _CONVERSION_READY
        return [word >> 8 if i % 2 == 0 else word & 0xFF for i in range(length)]


INA219: Final = SensorChip(
    measures="battery",
    keys=Ina219Keys,
    open=Ina219,
    simulate=simulated_at_address(SimulatedIna219),
)
