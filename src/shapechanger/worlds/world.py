"""What every world does, and what it shows to the sensors in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["RESTING_V", "Pose", "Readings", "World"]

RESTING_V: Final = 8.0
"""Voltage without load of two lithium cells that are nearly full."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a vehicle is, seen from above.

    Attributes:
        x: In metres.
        y: In metres.
        heading: Angle from the x axis in radians, counter-clockwise.
    """

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Readings:
    """What sensors on the vehicle could measure.

    Attributes:
        pose: Where the vehicle is.
        speed: Along its heading, m/s; backward is negative.
        travelled_m: Sum of all distances that the wheels rolled; backward counts down.
        acceleration_x: Along its heading, m/s2.
        acceleration_y: To its left, m/s2.
        yaw_rate: Counter-clockwise seen from above, rad/s.
        bumped: Whether something presses the bumper at its front.
        battery_v: Voltage of the battery under load.
        current_a: Current from the battery.
    """

    pose: Pose
    speed: float = 0.0
    travelled_m: float = 0.0
    acceleration_x: float = 0.0
    acceleration_y: float = 0.0
    yaw_rate: float = 0.0
    bumped: bool = False
    battery_v: float = 0.0
    current_a: float = 0.0


class World(Protocol):
    """A vehicle and what is around it.

    Attributes:
        resting_v: Voltage of the battery without load.
    """

    resting_v: float

    def lay_out(self, seed: int) -> None:
        """Put other surroundings around the vehicle, and the vehicle at a start in them."""
        ...

    def truth(self) -> dict[str, float]:
        """What no sensor on board tells, by name, for whoever judges; empty where nobody counts."""
        ...

    def place(self, seed: int) -> None:
        """Put the vehicle at a start, at rest."""
        ...

    def put_back(self) -> None:
        """Put a vehicle that ran into something where it can go on, at rest."""
        ...

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Let time go by.

        Args:
            dt_s: How much, in seconds.
            outputs: Value of each part, such as "wheels", from -1 to 1; None for one without
                torque.
        """
        ...

    def inputs(self) -> Readings:
        """What sensors could measure now."""
        ...

    def distance_m(self) -> float:
        """Distance from the vehicle's nose to whatever is ahead."""
        ...

    def picture(self) -> NDArray[np.uint8]:
        """What the front camera sees, RGB, shape (height, width, 3)."""
        ...
