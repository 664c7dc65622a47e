"""How a course looks to a camera: its light and its colours, as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from shapechanger.errors import UnknownName

__all__ = ["LOOKS", "VARIANTS", "Colour", "Look"]

Colour = tuple[float, float, float]
"""Red, green and blue, each a share from 0 to 1."""

VARIANTS: Final = 12
"""Sets of textures to draw from: few enough that a process keeps them all once painted."""

# What a full `warmth` leaves of red, green and blue: hardly any blue. The mean colour of frames
# that a car's camera took in a lit corridor at night was 76, 67, 14.
_WARM: Final = np.array([1.0, 0.92, 0.2])


@dataclass(frozen=True, slots=True)
class Look:
    """The light and the colours of a course.

    Attributes:
        light: How bright it is, from 0 (black) to 1 (broad day, or all lamps on).
        warmth: From 0 (white light) to 1 (the yellow-green of old lamps).
        contrast: From 0 (the same light everywhere) to 1 (dark between the lamps).
        gloss: Share of what the ground, or the water, mirrors: from 0 to 0.9.
        wall: What the walls' own colours are multiplied by.
        ground: What the ground's own colours are multiplied by.
        texture_seed: Which textures: stains, grain, the hue of each door; >= 0.
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
        """The usual look of a world.

        Raises:
            UnknownName: If there is no such world.
        """
        try:
            return LOOKS[world]
        except KeyError:
            raise UnknownName("world", world, LOOKS) from None

    @staticmethod
    def random(world: str, rng: np.random.Generator) -> Look:
        """A look drawn around the usual one: this is the domain randomization of pictures.

        Each is uniform: `light` x 0.6 to 1.4 (at most 1), `warmth` +- 0.35, `contrast` +- 0.3,
        `gloss` x 0.4 to 1.6, each channel of `wall` and `ground` x 0.75 to 1.0, and one of
        `VARIANTS` sets of textures.

        Raises:
            UnknownName: If there is no such world.
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
        """What is left of a colour in this light; each channel is from 0 to 1."""
        tinted = 1.0 - self.warmth * (1.0 - _WARM)
        red, green, blue = (float(x) for x in np.clip(self.light * tinted * own, 0.0, 1.0))
        return red, green, blue


LOOKS: Final[Mapping[str, Look]] = MappingProxyType(
    {
        "corridor": Look(light=0.72, warmth=0.9, contrast=0.75, gloss=0.42),
        "yard": Look(light=0.95, warmth=0.15, contrast=0.35, gloss=0.0),
        "harbour": Look(light=0.9, warmth=0.05, contrast=0.3, gloss=0.5),
    }
)
"""The usual look of each world."""
