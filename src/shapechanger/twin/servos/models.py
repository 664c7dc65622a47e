"""Models of servos, as the twin builds them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from shapechanger.errors import UnknownName

__all__ = ["MODELS", "TwinModel", "twin_model"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinModel:
    """One model: what it says of itself, and how it turns.

    Attributes:
        number: Model number.
        ampere_per_count: A.
        most_counts: Largest current limit.
        stall_nm: Stall torque at `volts`, N·m.
        stall_a: Current at it, A.
        no_load_rpm: Speed without load at `volts`, turns a minute.
        volts: V.
        least_v: Lowest voltage limit, V.
        most_v: Highest.
        most_c: Temperature limit, degrees Celsius.
        shutdown: Which hardware errors switch it off, as bits.
        inertia: Of motor and gears at the output, kg·m2.
        friction_nm: Coulomb friction at the output, N·m.
        viscous: N·m·s/rad.
    """

    number: int
    ampere_per_count: float
    most_counts: int
    stall_nm: float
    stall_a: float
    no_load_rpm: float
    volts: float
    least_v: float
    most_v: float
    most_c: int
    shutdown: int
    inertia: float
    friction_nm: float
    viscous: float

    @property
    def torque_constant(self) -> float:
        """N·m/A at the output."""
        return self.stall_nm / self.stall_a

    @property
    def electric_rad_per_s(self) -> float:
        """Speed at which no current flows any more: without load, friction still takes some."""
        no_load = self.no_load_rpm * 2.0 * math.pi / 60.0
        lost = (self.friction_nm + self.viscous * no_load) / self.stall_nm
        return no_load / (1.0 - lost)


# Limits, torques and speeds: ROBOTIS e-manual. Inertia and friction of the XL330-M288: identified
# by Rhoban's `bam` (xl330/m1); of the M077: the same, by the square of the gears' ratios; of the
# XC330-M288: fits on joints of a LEAP hand, its viscous part assumed as of the XL330. Of the XM430
# nothing was found: chosen.
_X330: Final = {
    "ampere_per_count": 1e-3,
    "volts": 5.0,
    "least_v": 3.5,
    "most_v": 7.0,
    "most_c": 70,
}
_XM430: Final = {
    "ampere_per_count": 2.69e-3,
    "most_counts": 1193,
    "stall_a": 2.3,
    "volts": 12.0,
    "least_v": 9.5,
    "most_v": 16.0,
    "most_c": 80,
    "shutdown": 52,
}
_MODELS: Final = {
    "XL330-M288": {
        **_X330,
        "number": 1200,
        "most_counts": 1750,
        "stall_nm": 0.52,
        "stall_a": 1.47,
        "no_load_rpm": 103.0,
        "shutdown": 53,
        "inertia": 0.00199,
        "friction_nm": 0.018,
        "viscous": 0.0059,
    },
    "XL330-M077": {
        **_X330,
        "number": 1190,
        "most_counts": 1750,
        "stall_nm": 0.215,
        "stall_a": 1.47,
        "no_load_rpm": 383.0,
        "shutdown": 53,
        "inertia": 0.000144,
        "friction_nm": 0.005,
        "viscous": 0.00043,
    },
    "XC330-M288": {
        **_X330,
        "number": 1240,
        "most_counts": 2352,
        "stall_nm": 0.93,
        "stall_a": 1.80,
        "no_load_rpm": 81.0,
        "shutdown": 52,
        "inertia": 0.00141,
        "friction_nm": 0.029,
        "viscous": 0.0059,
    },
    "XM430-W210": {
        **_XM430,
        "number": 1030,
        "stall_nm": 3.0,
        "no_load_rpm": 77.0,
        "inertia": 0.003,
        "friction_nm": 0.09,
        "viscous": 0.02,
    },
    "XM430-W350": {
        **_XM430,
        "number": 1020,
        "stall_nm": 4.1,
        "no_load_rpm": 46.0,
        "inertia": 0.008,
        "friction_nm": 0.12,
        "viscous": 0.05,
    },
}

MODELS: Final[Mapping[str, TwinModel]] = MappingProxyType(
    {name: TwinModel(**numbers) for name, numbers in _MODELS.items()}  # pyright: ignore[reportArgumentType]
)
"""The models that the twin can be, by name."""


def twin_model(name: str) -> TwinModel:
    """A model.

    Raises:
        UnknownName: If there is no such model.
    """
    if name not in MODELS:
        raise UnknownName("servo model", name, MODELS)
    return MODELS[name]
