"""Things and patches of sun, strewn over a lane by chance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shapechanger.worlds.course import Lamp
from shapechanger.worlds.layout.chance import picked
from shapechanger.worlds.layout.lines import arcs, normals
from shapechanger.worlds.layout.things import Furniture, Size

__all__ = ["Scatter", "scattered", "sunlit"]


@dataclass(frozen=True, slots=True)
class Scatter:
    """A kind of thing to strew.

    Attributes:
        size: What, and how large.
        share: How often it is chosen.
        moored: How often it lies along the wall, from 0 to 1.
    """

    size: Size
    share: float
    moored: float = 0.0


def scattered(
    rng: np.random.Generator, furniture: Furniture, kinds: tuple[Scatter, ...], per_m: float
) -> None:
    """Offer things to a lane, about `per_m` for each metre of it; those that fit stay."""
    route, half_width = furniture.lane.route, furniture.half_width
    along, left = arcs(route), normals(route)
    shares = [kind.share for kind in kinds]
    for _ in range(rng.poisson(per_m * float(along[-1]))):
        kind = kinds[picked(rng, shares)]
        i = int(rng.integers(len(route)))
        heading = float(np.arctan2(-left[i, 0], left[i, 1]))
        thing = kind.size.draw(rng, 0.0, 0.0, heading)
        if rng.random() < kind.moored:
            side = 1.0 if rng.random() < 0.5 else -1.0
            aside = side * (
                float(half_width[i]) - thing.width / 2.0 - float(rng.uniform(0.05, 0.3))
            )
        else:
            most = float(half_width[i]) - thing.width / 2.0
            aside = float(rng.uniform(-most, most))
            yaw = 0.0 if thing.is_round else float(rng.uniform(-np.pi, np.pi))
            thing = replace(thing, yaw=yaw)
        x, y = route[i] + left[i] * aside
        furniture.offer(replace(thing, x=float(x), y=float(y)), float(along[i]))


def sunlit(
    rng: np.random.Generator, route: NDArray[np.float64], half_width: NDArray[np.float64]
) -> tuple[Lamp, ...]:
    """Patches of sun on the lane, from two to eight."""
    left = normals(route)
    lamps: list[Lamp] = []
    for _ in range(int(rng.integers(2, 9))):
        i = int(rng.integers(len(route)))
        x, y = route[i] + left[i] * half_width[i] * float(rng.uniform(-0.6, 0.6))
        long, wide = float(rng.uniform(0.8, 2.0)), float(rng.uniform(0.4, 1.0))
        lamps.append(Lamp(float(x), float(y), float(rng.uniform(-np.pi, np.pi)), long, wide))
    return tuple(lamps)
