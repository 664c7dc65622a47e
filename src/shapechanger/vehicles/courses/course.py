"""Courses, their light and colours, and each vehicle's home world, as data without a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import WorldError, require_known

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

    Seen from `start` towards `end`, the lane is on the left; vehicles see only that side.
    """

    start: tuple[float, float]  # x and y, m.
    end: tuple[float, float]  # x and y, m.
    height: float  # Height above the ground, m.
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
    """An upright box or cylinder in the lane."""

    kind: ObstacleKind
    x: float  # Position of the middle, m.
    y: float
    yaw: float  # Angle of the length from the x axis, rad, counter-clockwise.
    length: float  # Length, or diameter of a cylinder, m.
    width: float  # Width, or diameter of a cylinder, m.
    height: float  # Height above the ground, m.

    @property
    def is_round(self) -> bool:
        """Return whether the obstacle is a cylinder."""
        return self.kind in ("plant", "cone", "post", "tree", "buoy", "bin")


@dataclass(frozen=True, slots=True)
class Lamp:
    """A rectangular light under the ceiling, or a patch of sun on the ground."""

    x: float  # Position of the middle, m.
    y: float
    yaw: float  # Angle of the length from the x axis, rad.
    length: float  # m.
    width: float  # m.


@dataclass(frozen=True, slots=True)
class Course:
    """A closed lane between walls, with obstacles in it; world and seed determine it."""

    world: str  # Kind of course: "corridor", "yard", "harbour" or "flooded-corridor".
    seed: int
    # Middle of the lane in driving direction, m, (N, 2): a closed line of points that are `spacing`
    # apart. The last point is one `spacing` before the first.
    route: NDArray[np.float64]
    half_width: NDArray[np.float64]  # Distance from the route to the nearest wall, m, (N,).
    walls: tuple[Wall, ...]
    obstacles: tuple[Obstacle, ...]
    lamps: tuple[Lamp, ...]
    ceiling_m: float  # Height of the ceiling; 0 under the open sky.
    gap_m: float  # Width of the narrowest passage between obstacles and walls.
    current_mps: tuple[float, float] = (0.0, 0.0)  # Flow of the water, x and y.

    @property
    def spacing(self) -> float:
        """Distance between two points of the route, m."""
        return float(np.hypot(*(self.route[1] - self.route[0])))


def require_element(vehicle: str, *, floats: bool, world: str) -> None:
    """Raise a `WorldError` if a floating vehicle has no water, or another vehicle has water."""
    if floats != (world in WATER):
        reason = "floats" if floats else "does not float"
        raise WorldError(f"A {vehicle} {reason}: it cannot drive in a {world}.")


Colour = tuple[float, float, float]
"""Red, green and blue, each a share from 0 to 1."""

VARIANTS: Final = 12
"""Number of texture sets that random looks use, small enough to cache all sets."""

# Red, green and blue of the light at a `warmth` of 1. The mean colour of images that a car's camera
# took in a lit corridor at night was 76, 67, 14.
_WARM: Final = np.array([1.0, 0.92, 0.2])


@dataclass(frozen=True, slots=True)
class Look:
    """Light and colours of a course."""

    light: float = 0.8  # Brightness, from 0 (black) to 1 (daylight, or all lamps on).
    warmth: float = 0.3  # Colour of the light, from 0 (white) to 1 (yellow-green of old lamps).
    contrast: float = 0.5  # From 0 (the same light everywhere) to 1 (dark between the lamps).
    gloss: float = 0.3  # Reflectance of the ground or the water, 0 to 0.9.
    wall: Colour = (1.0, 1.0, 1.0)  # Factors on the colours of the walls.
    ground: Colour = (1.0, 1.0, 1.0)  # Factors on the colour of the ground.
    texture_seed: int = 0

    @staticmethod
    def of(world: str) -> Look:
        """Usual look of a world."""
        require_known("world", LOOKS, world)
        return LOOKS[world]

    @staticmethod
    def random(world: str, rng: np.random.Generator) -> Look:
        """Draw a look around the usual one of a world, uniformly, with one of `VARIANTS` textures.

        `light` x 0.6 to 1.4, `warmth` +- 0.35, `contrast` +- 0.3, `gloss` x 0.4 to 1.6, all clipped
        to their ranges; each channel of `wall` and `ground` x 0.75 to 1.0.
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
