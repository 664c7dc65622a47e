"""Light sensor BH1750 over I2C, as another package would add it."""

from typing import Annotated

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.contract.world import World
from shapechanger.layout import Element, Feature
from shapechanger.robot.drivers.chip import I2cDevice, I2cKeys, SensorChip, simulated_at_address
from shapechanger.robot.drivers.simulation import SimulatedChip
from shapechanger.robot.hardware import Hardware

_MEASURE = 0x10  # Continuously, in steps of 1/1.2 lx.
_COUNTS_PER_LUX = 1.2
LUX = 240.0
"""Illuminance in the twin's world, lx."""


class Bh1750Keys(I2cKeys, frozen=True, kw_only=True):
    """Keys of a BH1750."""

    address: Annotated[int, Meta(ge=0x23, le=0x5C)] = 0x23


class Bh1750(I2cDevice):
    """Light sensor; see `SensorDriver`."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        super().__init__(f"Sensor {plan.name!r}", Bh1750Keys.of(plan.settings), hardware)
        self._quantity = f"{plan.name}/light"

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        return {self._quantity: int.from_bytes(self.read_registers(_MEASURE, 2)) / _COUNTS_PER_LUX}


class SimulatedBh1750(SimulatedChip):
    """A BH1750 in constant light."""

    def __init__(self, world: World) -> None:
        """Ignore the world."""

    def read(self, register: int, length: int) -> list[int]:
        return list(round(LUX * _COUNTS_PER_LUX).to_bytes(length, "big"))


def _features(plan: SensorPlan) -> list[Feature]:
    return [Feature(f"{plan.name}/light", "lx", 0.0, 65_535.0, Element("sensor", plan.name))]


CHIP = SensorChip(
    measures="light",
    keys=Bh1750Keys,
    open=Bh1750,
    simulate=simulated_at_address(SimulatedBh1750),
    features=_features,
)
