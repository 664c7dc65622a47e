"""Courses, their light and colours, and each vehicle's home world, as data without a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import UnknownName, WorldError

TRAINING: Final = range(0, 1_000_000)
"""Seeds of the courses for training."""

HELD_OUT: Final = range(1_000_000, 2_000_000)
"""Seeds of the courses for evaluation, which are never used for training."""

HOME: Final[Mapping[str, str]] = MappingProxyType(
    {"boat": "harbour", "car": "corridor", "tank": "corridor", "truck": "yard"}
)
"""Default world of each vehicle."""

FLOODED: Final = "flooded-corridor"
"""World with the courses of corridors, flooded so that a boat can drive on them."""

WATER: Final = frozenset({"harbour", FLOODED})
"""Worlds for vehicles that float."""

Surface = Literal[
    "plaster", "door", "window", "brick", "board", "glass", "hedge", "fence", "quay", "shed", "rock"
]
"""Material of the visible side of a wall."""

ObstacleKind = Literal[
    "box", "bin", "bench", "plant", "cone", "post", "cabinet", "crate", "tree", "buoy", "dinghy"
]


@dataclass(frozen=True, slots=True)
class Wall:
    """An upright rectangle.

    Seen from `start` towards `end`, the lane is on the left; only that side is ever visible.

    Attributes:
        start: x and y of the start, m.
        end: x and y of the end, m.
        height: Height above the ground, m.
        surface: Material.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    height: float
    surface: Surface

    @staticmethod
    def between(
        start: NDArray[np.float64], end: NDArray[np.float64], height: float, surface: Surface
    ) -> Wall:
        """A wall between two points, m, (2,)."""
        (x0, y0), (x1, y1) = start.tolist(), end.tolist()
        return Wall((x0, y0), (x1, y1), height, surface)

    def frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Start, m, unit vector towards the end, and length, m; (2,), (2,) and a number."""
        start, ahead = np.asarray(self.start, float), np.subtract(self.end, self.start)
        length = float(np.hypot(*ahead))
        return start, ahead / length, length

    def behind(self) -> NDArray[np.float64]:
        """Unit vector away from the lane, (2,)."""
        _, (x, y), _ = self.frame()
        return np.array([y, -x])


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An upright box or cylinder in the lane.

    Attributes:
        kind: Kind, which also decides whether the obstacle is a box or a cylinder.
        x: Position of the middle, m.
        y: Position of the middle, m.
        yaw: Angle of the length from the x axis, rad, counter-clockwise.
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
        """Return whether the obstacle is a cylinder."""
        return self.kind in ("plant", "cone", "post", "tree", "buoy", "bin")


@dataclass(frozen=True, slots=True)
class Lamp:
    """A rectangular light under the ceiling, or a patch of sun on the ground.

    Attributes:
        x: Position of the middle, m.
        y: Position of the middle, m.
        yaw: Angle of the length from the x axis, rad.
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


def require_element(vehicle: str, *, floats: bool, world: str) -> None:
    """Raise a `WorldError` unless a world has water exactly if the vehicle floats."""
    if floats != (world in WATER):
        reason = "floats" if floats else "does not float"
        raise WorldError(f"A {vehicle} {reason}: it cannot drive in a {world}.")


Colour = tuple[float, float, float]
"""Red, green and blue, each a share from 0 to 1."""

VARIANTS: Final = 12
"""Number of texture sets that random looks use, small enough to cache all sets."""

# Red, green and blue of the light at a `warmth` of 1. For comparison, the mean colour of images of
# a car's camera in a lit corridor at night was 76, 67, 14.
_WARM: Final = np.array([1.0, 0.92, 0.2])


@dataclass(frozen=True, slots=True)
class Look:
    """Light and colours of a course.

    Attributes:
        light: Brightness, from 0 (black) to 1 (daylight, or all lamps on).
        warmth: Colour of the light, from 0 (white) to 1 (the yellow-green of old lamps).
        contrast: From 0 (the same light everywhere) to 1 (dark between the lamps).
        gloss: Reflectance of the ground or the water, 0 to 0.9.
        wall: Factors on red, green and blue of the walls.
        ground: Factors on red, green and blue of the ground.
        texture_seed: Seed of the textures, >= 0.
    """

    light: float = 0.8
    warmth: float = 0.3
    contrast: float = 0.5
    gloss: float = 0.3
    wall: Colour = (1.0, 1.0, 1.0)
    ground: Colour = (1.0, 1.0, 1.0)
    texture_seed: int = 0

    @staticmethod
    def of(world: str) -> Look:
        """Usual look of a world."""
        if world not in LOOKS:
            raise UnknownName("world", world, LOOKS)
        return LOOKS[world]

    @staticmethod
    def random(world: str, rng: np.random.Generator) -> Look:
        """Draw a look around the usual one of a world, uniformly, with one of `VARIANTS` textures.

        `light` x 0.6 to 1.4 (at most 1), `warmth` +- 0.35, `contrast` +- 0.3, `gloss` x 0.4 to 1.6,
        each channel of `wall` and `ground` x 0.75 to 1.0.
        """
        usual = Look.of(world)

        def tint(colour: Colour) -> Colour:
            red, green, blue = (float(c * rng.uniform(0.75, 1.0)) for c in colour)
            return red, green, blue

        return Look(
            light=float(min(1.0, usual.light * rng.uniform(0.6, 1.4))),
            warmth=float(np.clip(usual.warmth + rng.uniform(-0.35, 0.35), 0.0, 1.0)),
            contrast=float(np.clip(usual.contrast + rng.uniform(-0.3, 0.3), 0.0, 1.0)),
            gloss=float(min(0.9, usual.gloss * rng.uniform(0.4, 1.6))),
            wall=tint(usual.wall),
            ground=tint(usual.ground),
            texture_seed=int(rng.integers(VARIANTS)),
        )

    def tone(self, colour: Colour = (1.0, 1.0, 1.0)) -> Colour:
        """Return a colour as it appears in this light, each channel from 0 to 1."""
        tinted = 1.0 - self.warmth * (1.0 - _WARM)
        red, green, blue = (float(x) for x in np.clip(self.light * tinted * colour, 0.0, 1.0))
        return red, green, blue


LOOKS: Final[Mapping[str, Look]] = MappingProxyType(
    {
        "corridor": Look(light=0.72, warmth=0.9, contrast=0.75, gloss=0.42),
        "yard": Look(light=0.95, warmth=0.15, contrast=0.35, gloss=0.0),
        "harbour": Look(light=0.9, warmth=0.05, contrast=0.3, gloss=0.5),
        FLOODED: Look(light=0.72, warmth=0.9, contrast=0.75, gloss=0.5),
    }
)
"""Usual look of each world."""
