"""Light and colours of a course, as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from shapechanger.errors import UnknownName
from shapechanger.vehicles.courses.course import FLOODED

Colour = tuple[float, float, float]
"""Red, green and blue, each a share from 0 to 1."""

VARIANTS: Final = 12
"""Number of texture sets that looks are drawn from; few enough to cache them all."""

# Red, green and blue at a `warmth` of 1. The mean colour of a car's camera in a lit corridor at
# night was 76, 67, 14.
_WARM: Final = np.array([1.0, 0.92, 0.2])


@dataclass(frozen=True, slots=True)
class Look:
    """Light and colours of a course.

    Attributes:
        light: Brightness, from 0 (black) to 1 (daylight, or all lamps on).
        warmth: Colour of the light, from 0 (white) to 1 (the yellow-green of old lamps).
        contrast: From 0 (the same light everywhere) to 1 (dark between the lamps).
        gloss: Reflectance of the ground or the water, 0 to 0.9.
        wall: Factors on the colours of the walls.
        ground: Factors on the colours of the ground.
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
        """Usual look of a world.

        Raises:
            UnknownName: If the world is unknown.
        """
        try:
            return LOOKS[world]
        except KeyError:
            raise UnknownName("world", world, LOOKS) from None

    @staticmethod
    def random(world: str, rng: np.random.Generator) -> Look:
        """Domain randomization of the look, around that of a world.

        All are uniform: `light` x 0.6 to 1.4 (at most 1), `warmth` +- 0.35, `contrast` +- 0.3,
        `gloss` x 0.4 to 1.6, each channel of `wall` and `ground` x 0.75 to 1.0, and one of
        `VARIANTS` texture sets.

        Args:
            world: Kind of course.
            rng: Random generator.

        Raises:
            UnknownName: If the world is unknown.
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

    def tone(self, own: Colour = (1.0, 1.0, 1.0)) -> Colour:
        """A colour in this light, each channel from 0 to 1."""
        tinted = 1.0 - self.warmth * (1.0 - _WARM)
        red, green, blue = (float(x) for x in np.clip(self.light * tinted * own, 0.0, 1.0))
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
