"""Chips on an I2C bus: their keys, their device, and their simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.robot.drivers.chip import Claim, Keys, device_errors
from shapechanger.robot.drivers.pins import I2C_PINS
from shapechanger.robot.drivers.simulation import SimulatedChip, SimulatedSensor
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # Only a twin has a world.
    from shapechanger.contract.world import World

BusNumber = Annotated[int, Meta(ge=0, le=99)]
"""Number of an I2C bus; 1 is GPIO2 and GPIO3."""


class I2cKeys(Keys, frozen=True, kw_only=True):
    """Keys of a chip on an I2C bus.

    Attributes:
        bus: Number of the bus; 1 is GPIO2 and GPIO3.
        address: Address of the chip.
    """

    bus: BusNumber = 1
    address: int

    def claims(self) -> Iterator[Claim]:
        """Return the claims of the bus and the address."""
        return i2c_claims(self.bus, "address", self.address)


def i2c_claims(bus: int, key: str, address: int, group: str = "") -> Iterator[Claim]:
    """Return the claims of a chip on an I2C bus.

    Args:
        bus: Number of the bus.
        key: Key of the address.
        address: The address.
        group: What the chip shares its address with; "" for nothing.
    """
    yield Claim(key, f"address {address:#x} of I2C bus {bus}", group)
    for pin in I2C_PINS.get(bus, ()):
        yield Claim("bus", f"GPIO{pin}", f"I2C bus {bus}", f", a wire of I2C bus {bus},")


class I2cDevice:
    """A chip on an I2C bus, whose errors name it; the base of its driver.

    Args:
        name: Name of the device, such as "Sensor 'imu'".
        keys: Its bus and address.
        hardware: The buses of this robot.

    Attributes:
        name: The name with the address, for messages.
    """

    def __init__(self, name: str, keys: I2cKeys, hardware: Hardware) -> None:
        self.name = f"{name} at 0x{keys.address:02x} on I2C bus {keys.bus}"
        self._address = keys.address
        with device_errors(self.name):
            self._bus = hardware.i2c(keys.bus)

    def read_registers(self, register: int, length: int = 1) -> bytes:
        """Read consecutive registers."""
        with device_errors(self.name):
            return bytes(self._bus.read_i2c_block_data(self._address, register, length))

    def write_registers(self, register: int, *data: int) -> None:
        """Write consecutive registers, one byte each."""
        with device_errors(self.name):
            self._bus.write_i2c_block_data(self._address, register, data)

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()


def simulated_at_address(
    chip: Callable[[World], SimulatedChip],
) -> Callable[[SensorPlan, World], SimulatedSensor]:
    """Return the simulation of a sensor that is one chip, at the address in its settings."""

    def simulate(plan: SensorPlan, world: World) -> SimulatedSensor:
        return SimulatedSensor({(plan.settings["bus"], plan.settings["address"]): chip(world)})

    return simulate
