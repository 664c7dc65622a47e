"""Courses as plain values, without simulator and pictures, and the vehicles' home worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import WorldError

TRAINING: Final = range(0, 1_000_000)
"""Seeds of the courses for training."""

HELD_OUT: Final = range(1_000_000, 2_000_000)
"""Seeds of the courses for evaluation; nothing is trained on them."""

HOME: Final[Mapping[str, str]] = MappingProxyType(
    {"boat": "harbour", "car": "corridor", "tank": "corridor", "truck": "yard"}
)
"""Default world of each vehicle."""

FLOODED: Final = "flooded-corridor"
"""The corridor with water for a floor, on which a boat drives the courses of land vehicles."""

WATER: Final = frozenset({"harbour", FLOODED})
"""Worlds for vehicles that float."""

Surface = Literal[
    "plaster", "door", "window", "brick", "board", "glass", "hedge", "fence", "quay", "shed", "rock"
]
"""Material of the visible side of a wall."""

ObstacleKind = Literal[
    "box", "bin", "bench", "plant", "cone", "post", "cabinet", "crate", "tree", "buoy", "dinghy"
]
"""Kind of an obstacle."""


@dataclass(frozen=True, slots=True)
class Wall:
    """An upright rectangle.

    Seen from `start` towards `end`, the lane is on the left; only that side is ever visible.

    Attributes:
        start: x and y of its start, m.
        end: x and y of its end, m.
        height: Height above the ground, m.
        surface: Material.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    height: float
    surface: Surface


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An upright box or cylinder in the lane.

    Attributes:
        kind: Kind, which also decides whether it is a box or a cylinder.
        x: Position of its middle, m.
        y: Position of its middle, m.
        yaw: Angle of its length from the x axis, rad, counter-clockwise.
        length: Length, or diameter of a cylinder, m.
        width: Width, or diameter of a cylinder, m.
        height: Height above the ground, m.
    """

    kind: ObstacleKind
    x: float
    y: float
    yaw: float
    length: float
    width: float
    height: float

    @property
    def is_round(self) -> bool:
        """Return whether it is a cylinder."""
        return self.kind in ("plant", "cone", "post", "tree", "buoy", "bin")


@dataclass(frozen=True, slots=True)
class Lamp:
    """A rectangular light under the ceiling, or a patch of sun on the ground.

    Attributes:
        x: Position of its middle, m.
        y: Position of its middle, m.
        yaw: Angle of its length from the x axis, rad.
        length: Length, m.
        width: Width, m.
    """

    x: float
    y: float
    yaw: float
    length: float
    width: float


@dataclass(frozen=True, slots=True)
class Course:
    """A closed lane between walls, with obstacles in it.

    Attributes:
        world: Kind of course: "corridor", "yard", "harbour" or "flooded-corridor".
        seed: Seed; world and seed determine the course.
        route: Middle of the lane in driving direction, m, (N, 2): a closed line of points that are
            `spacing` apart. The last point is one `spacing` before the first.
        half_width: Distance from the route to the nearest wall, without obstacles, m, (N,).
        walls: Walls on both sides.
        obstacles: Obstacles in the lane; each leaves a gap of at least `gap_m`.
        lamps: Lights.
        ceiling_m: Height of the ceiling; 0 under the open sky.
        gap_m: Width of the narrowest passage between obstacles and walls, m.
        current_mps: Flow of the water, x and y, m/s; 0 on land.
    """

    world: str
    seed: int
    route: NDArray[np.float64]
    half_width: NDArray[np.float64]
    walls: tuple[Wall, ...]
    obstacles: tuple[Obstacle, ...]
    lamps: tuple[Lamp, ...]
    ceiling_m: float
    gap_m: float
    current_mps: tuple[float, float] = (0.0, 0.0)

    @property
    def spacing(self) -> float:
        """Distance between two points of the route, m."""
        return float(np.hypot(*(self.route[1] - self.route[0])))

    @property
    def length(self) -> float:
        """Length of the route, m."""
        steps = np.diff(self.route, axis=0, append=self.route[:1])
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def require_element(vehicle: str, *, floats: bool, world: str) -> None:
    """Check that a world has water if, and only if, the vehicle floats.

    Args:
        vehicle: Name of the vehicle.
        floats: Whether it floats.
        world: Kind of course.

    Raises:
        WorldError: If the vehicle cannot drive there.
    """
    if floats != (world in WATER):
        reason = "floats" if floats else "does not float"
        raise WorldError(f"A {vehicle} {reason}: it cannot drive in a {world}.")
