"""What was found out about a finger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger import JOINTS, TENDONS, FingerParameters
from shapechanger.identify.replay import HeldOut

__all__ = ["Estimate", "Identified"]


@dataclass(frozen=True, slots=True)
class Estimate:
    """One number of a finger.

    Attributes:
        name: Which, such as `moment_arms/FDP/MCP_flexion`.
        unit: Its unit.
        value: What it probably is.
        low: Lower end of its 95 % interval.
        high: Upper end.
        nominal: What it is in the nominal finger; infinite for the stiffness of tendons that do not
            give.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    nominal: float

    @property
    def differs(self) -> bool:
        """Whether the interval leaves out the nominal value."""
        return not self.low <= self.nominal <= self.high


@dataclass(frozen=True, slots=True)
class Identified:
    """A finger as its log shows it.

    Attributes:
        parameters: The finger, to build it or to hand it to an env as `parameters`.
        estimates: What was told, number by number, with intervals; the arms first.
        untold: What this log cannot tell, each with the reason and what is taken in its place.
        held_out: What the identified finger makes of commands that it was not fitted to.
        source: What the log says that it is of.
        seconds: Length of the log, s.
    """

    parameters: FingerParameters
    estimates: tuple[Estimate, ...]
    untold: tuple[tuple[str, str], ...]
    held_out: HeldOut
    source: str
    seconds: float

    @property
    def arm_intervals(self) -> NDArray[np.float64]:
        """95 % intervals of the moment arms, m, (7, 4, 2); both 0 where there is none."""
        ends = np.zeros((len(TENDONS), len(JOINTS), 2))
        for estimate in self.arms:
            _, tendon, joint = estimate.name.split("/")
            ends[TENDONS.index(tendon), JOINTS.index(joint)] = estimate.low, estimate.high
        return ends

    @property
    def arms(self) -> tuple[Estimate, ...]:
        """The estimates of moment arms."""
        return tuple(e for e in self.estimates if e.name.startswith("moment_arms/"))
