"""Models of servos, with the numbers of their data sheets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from shapechanger.errors import UnknownName

__all__ = ["MODELS", "ServoModel", "model_named"]


@dataclass(frozen=True, slots=True)
class ServoModel:
    """One model.

    Attributes:
        name: What it is called.
        number: What it answers to a ping.
        ampere_per_count: Unit of its currents, A.
        most_counts: Largest value of its current limit.
        torque_constant: Torque at the output per ampere, N·m/A: stall torque over stall current.
        no_load_rad_per_s: Speed without load.
        least_v: Lowest voltage it works at, V.
        most_v: Highest.
        most_c: Temperature at which it switches itself off, degrees Celsius.
        least_firmware: First version whose bus watchdog can be trusted.
        friction_nm: What its gears hold against, at the output, N·m; None where nobody measured it.
    """

    name: str
    number: int
    ampere_per_count: float
    most_counts: int
    torque_constant: float
    no_load_rad_per_s: float
    least_v: float
    most_v: float
    most_c: float
    least_firmware: int = 0
    friction_nm: float | None = None


def _rpm(value: float) -> float:
    return value * 2.0 * math.pi / 60.0


# Source: ROBOTIS e-manual; X330 at 5 V, XM430 at 12 V. Friction: XL330-M288 identified by Rhoban's
# `bam` (xl330/m1), XC330-M288 fitted on joints of a LEAP hand. The bus watchdog of the X430 needs
# firmware 38 (e-manual, Bus Watchdog).
_MODELS: Final = (
    ServoModel("XL330-M288", 1200, 1e-3, 1750, 0.52 / 1.47, _rpm(103), 3.5, 7, 70, 0, 0.018),
    ServoModel("XL330-M077", 1190, 1e-3, 1750, 0.215 / 1.47, _rpm(383), 3.5, 7, 70),
    ServoModel("XC330-M288", 1240, 1e-3, 2352, 0.93 / 1.80, _rpm(81), 3.5, 7, 70, 0, 0.029),
    ServoModel("XM430-W210", 1030, 2.69e-3, 1193, 3.0 / 2.3, _rpm(77), 9.5, 16, 80, 38),
    ServoModel("XM430-W350", 1020, 2.69e-3, 1193, 4.1 / 2.3, _rpm(46), 9.5, 16, 80, 38),
)

MODELS: Final[Mapping[str, ServoModel]] = MappingProxyType({one.name: one for one in _MODELS})
"""The models that the driver knows, by name."""


def model_named(name: str) -> ServoModel:
    """A model.

    Raises:
        UnknownName: If there is no such model.
    """
    if name not in MODELS:
        raise UnknownName("servo model", name, MODELS)
    return MODELS[name]
