"""What a place to drive in consists of, as plain values: no simulator, no picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import WorldError

__all__ = [
    "HELD_OUT",
    "HOME",
    "TRAINING",
    "Course",
    "Lamp",
    "Surface",
    "Thing",
    "ThingKind",
    "Wall",
    "require_element",
]

TRAINING: Final = range(0, 1_000_000)
"""Seeds of the courses that vehicles learn on."""

HELD_OUT: Final = range(1_000_000, 2_000_000)
"""Seeds of the courses that they are judged on, and never learn on."""

Surface = Literal[
    "plaster", "door", "window", "brick", "board", "glass", "hedge", "fence", "quay", "shed", "rock"
]
"""What the side of a wall that can be seen is made of."""

ThingKind = Literal[
    "box", "bin", "bench", "plant", "cone", "post", "cabinet", "crate", "tree", "buoy", "dinghy"
]
"""What stands, or floats, in the way."""


@dataclass(frozen=True, slots=True)
class Wall:
    """An upright rectangle that nothing passes.

    Who looks from `start` to `end` has the free space at the left hand; only that side is ever
    seen.

    Attributes:
        start: x and y of its beginning, m.
        end: x and y of its end, m.
        height: Above the ground, m.
        surface: What it is made of.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    height: float
    surface: Surface


@dataclass(frozen=True, slots=True)
class Thing:
    """Something that stands in the way: an upright box, or a cylinder where it is round.

    Attributes:
        kind: What it is.
        x: Of its middle, m.
        y: Of its middle, m.
        yaw: Angle of its length from the x axis, rad, counter-clockwise.
        length: m; of a round thing the diameter.
        width: m; of a round thing the diameter.
        height: Above the ground, m.
    """

    kind: ThingKind
    x: float
    y: float
    yaw: float
    length: float
    width: float
    height: float

    @property
    def is_round(self) -> bool:
        """Whether it is a cylinder."""
        return self.kind in ("plant", "cone", "post", "tree", "buoy", "bin")


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light under the ceiling, or a patch of sun: bright itself, and a gloss on the ground below.

    Attributes:
        x: Of its middle, m.
        y: Of its middle, m.
        yaw: Angle of its length from the x axis, rad.
        length: m.
        width: m.
    """

    x: float
    y: float
    yaw: float
    length: float
    width: float


@dataclass(frozen=True, slots=True)
class Course:
    """A closed course: a lane between walls, with things in it, that can be driven round for ever.

    Attributes:
        world: Kind of place: "corridor", "yard" or "harbour".
        seed: What it follows from, with `world`.
        route: (N, 2) middle of the lane, m: a closed line whose points are `spacing` apart, in the
            direction of driving. The last point is one `spacing` before the first.
        half_width: (N,) distance from the middle to the walls on either side, m, things aside.
        walls: What bounds it.
        things: What stands in it. Past each there is a gap of at least `gap_m`.
        lamps: Where light comes from.
        ceiling_m: Height of the ceiling; 0 under the open sky.
        gap_m: Narrowest way through, m, between things and walls.
        current_mps: Flow of the water, x and y, m/s; 0 on land.
    """

    world: str
    seed: int
    route: NDArray[np.float64]
    half_width: NDArray[np.float64]
    walls: tuple[Wall, ...]
    things: tuple[Thing, ...]
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
        """Once round, m."""
        steps = np.diff(self.route, axis=0, append=self.route[:1])
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


HOME: Final[Mapping[str, str]] = MappingProxyType(
    {"boat": "harbour", "car": "corridor", "tank": "corridor", "truck": "yard"}
)
"""Kind of place by the name of the vehicle."""


def require_element(vehicle: str, *, floats: bool, world: str) -> None:
    """Refuse a place of the wrong element: who floats needs water, and nobody else drives on it.

    Args:
        vehicle: Name of the vehicle.
        floats: Whether it floats.
        world: Kind of place.

    Raises:
        WorldError: If the vehicle cannot drive there.
    """
    if floats != (world == HOME["boat"]):
        what = "floats" if floats else "does not float"
        raise WorldError(f"A {vehicle} {what}: it cannot drive in a {world}.")
