"""Yards: a winding lane between hedges, fences, sheds and brick walls, with obstacles in it."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.course import Course
from shapechanger.worlds.layout.channel import Channel, Stretch, banks, dug
from shapechanger.worlds.layout.distances import cross_each_other, segments
from shapechanger.worlds.layout.scatter import Scatter, scattered, sunlit
from shapechanger.worlds.layout.things import Furniture, Lane, Size

__all__ = ["yard"]

_SHAPE: Final = Channel(
    pitch=(5.5, 8.0),
    cells=(3, 5),
    blur=(2.1, 4.5),
    length=(40.0, 88.0),
    radius=1.9,
    half_width=(1.6, 2.45),
    wall=0.25,
)
_GAP_M = 1.2
_SPACING_M = 0.1

_BANKS = (
    Stretch("hedge", 0.4, (3.0, 12.0), 1.0, (0.9, 1.9)),
    Stretch("fence", 0.25, (3.0, 10.0), 1.3, (0.9, 1.6)),
    Stretch("brick", 0.2, (2.5, 8.0), 1.2, (1.2, 2.2)),
    Stretch("shed", 0.15, (2.0, 4.0), 1.6, (2.1, 2.5)),
)

_THINGS = (
    Scatter(Size("cone", (0.22, 0.34), (0.22, 0.34), (0.4, 0.7)), 0.3),
    Scatter(Size("crate", (0.35, 0.6), (0.3, 0.45), (0.25, 0.5)), 0.2),
    Scatter(Size("bin", (0.4, 0.55), (0.4, 0.55), (0.8, 1.1)), 0.15),
    Scatter(Size("post", (0.08, 0.16), (0.08, 0.16), (0.7, 1.2)), 0.15),
    Scatter(Size("tree", (0.2, 0.4), (0.2, 0.4), (2.5, 4.0)), 0.2),
)


def yard(rng: np.random.Generator, seed: int) -> Course | None:
    """One attempt at a course; None where chance made none that fits."""
    shape = dug(rng, _SHAPE, _SPACING_M)
    if shape is None:
        return None
    lane = Lane(shape[0], *banks(rng, *shape, _BANKS))
    if cross_each_other(segments((*lane.left, *lane.right))):
        return None
    half_width = lane.half_width()
    if half_width.min() < 1.5 or half_width.max() > 2.5:
        return None
    furniture = Furniture(lane, half_width, _GAP_M)
    scattered(rng, furniture, _THINGS, per_m=float(rng.uniform(0.12, 0.4)))
    return Course(
        world="yard",
        seed=seed,
        route=lane.route,
        half_width=half_width,
        walls=(*lane.left, *lane.right),
        things=tuple(furniture.things),
        lamps=sunlit(rng, lane.route, half_width),
        ceiling_m=0.0,
        gap_m=furniture.gap_m,
    )
