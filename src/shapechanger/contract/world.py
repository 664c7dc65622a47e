"""Interface of simulated worlds, and the quantities that sensors measure in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

RESTING_V: Final = 8.0
"""Voltage without load of two nearly full lithium cells."""

STANDING_MPS: Final = 0.1
"""Speed, m/s, below which a vehicle that does not turn counts as standing."""

STANDING_RADPS: Final = 0.1
"""Rate of turn, rad/s, below which a vehicle counts as not turning."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of a vehicle seen from above.

    Attributes:
        x: Position along the x axis, m.
        y: Position along the y axis, m.
        heading: Angle from the x axis, rad, counter-clockwise.
    """

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Readings:
    """True values of the quantities that sensors on the vehicle measure.

    Attributes:
        pose: Pose of the vehicle.
        speed: Speed along its heading, m/s; backward is negative.
        travelled_m: Distance that the wheels have rolled, m; it decreases while rolling backward.
        acceleration_x: Acceleration along its heading, m/s2.
        acceleration_y: Acceleration to its left, m/s2.
        yaw_rate: Rate of turn, rad/s, counter-clockwise seen from above.
        bumped: Whether the front bumper is pressed.
        battery_v: Voltage of the battery under load, V.
        current_a: Current from the battery, A.
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

    @property
    def stands(self) -> bool:
        """Return whether the vehicle neither moves nor turns."""
        return abs(self.speed) < STANDING_MPS and abs(self.yaw_rate) < STANDING_RADPS


class World(Protocol):
    """A vehicle and its surroundings.

    By default, the vehicle neither moves nor sees; subclasses override the methods.
    """

    def lay_out(self, seed: int) -> None:
        """Draw the surroundings, and put the vehicle at a start."""
        self.place(seed)

    def truth(self) -> dict[str, float]:
        """Return ground truth for evaluation that sensors do not measure, keyed by name."""
        ...

    def place(self, seed: int) -> None:
        """Put the vehicle at rest at a start that `seed` draws."""
        ...

    def put_back(self) -> None:
        """Put the vehicle at rest after a collision: at a free place nearby, by default a start."""
        self.place(0)

    def advance(self, dt_s: float, outputs: Mapping[str, float | None]) -> None:
        """Simulate the world for a duration.

        Args:
            dt_s: Duration, s.
            outputs: Output of each part, such as "wheels", from -1 to 1; None for a part without
                torque.
        """
        ...

    def inputs(self) -> Readings:
        """Return the true values of quantities that sensors measure."""
        return Readings(Pose(0.0, 0.0, 0.0), battery_v=RESTING_V)

    def distance_m(self) -> float:
        """Return the distance from the vehicle's nose to the nearest object ahead, m."""
        return 0.0

    def picture(self) -> NDArray[np.uint8]:
        """Return the image of the front camera, RGB, shape (height, width, 3)."""
        return np.zeros((120, 160, 3), np.uint8)
