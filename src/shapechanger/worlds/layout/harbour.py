"""Harbours: a channel between quays and rocks, with buoys, dinghies and crates, and a current."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.course import Course
from shapechanger.worlds.layout.channel import Channel, Stretch, banks, dug
from shapechanger.worlds.layout.distances import cross_each_other, segments
from shapechanger.worlds.layout.scatter import Scatter, scattered, sunlit
from shapechanger.worlds.layout.things import Furniture, Lane, Size

__all__ = ["QUAY_M", "harbour"]

QUAY_M: Final = 0.6
"""Height of a quay above the water."""

_SHAPE: Final = Channel(
    pitch=(7.0, 10.5),
    cells=(3, 4),
    blur=(2.6, 6.0),
    length=(48.0, 88.0),
    radius=2.6,
    half_width=(2.15, 3.4),
    wall=0.45,
)
_GAP_M = 1.6
_SPACING_M = 0.1
_MOST_CURRENT_MPS = 0.15

_BANKS = (
    Stretch("quay", 0.7, (5.0, 16.0), 2.0, (QUAY_M, QUAY_M)),
    Stretch("rock", 0.3, (2.5, 8.0), 0.8, (0.35, 0.9), rough=0.35),
)

_THINGS = (
    Scatter(Size("buoy", (0.35, 0.6), (0.35, 0.6), (0.5, 0.9)), 0.4),
    Scatter(Size("crate", (0.4, 0.7), (0.4, 0.6), (0.25, 0.4)), 0.25),
    # Dinghies lie along the quay.
    Scatter(Size("dinghy", (1.4, 2.0), (0.7, 0.9), (0.4, 0.5)), 0.35, moored=0.75),
)


def harbour(rng: np.random.Generator, seed: int) -> Course | None:
    """One attempt at a course; None where chance made none that fits."""
    shape = dug(rng, _SHAPE, _SPACING_M)
    if shape is None:
        return None
    lane = Lane(shape[0], *banks(rng, *shape, _BANKS))
    if cross_each_other(segments((*lane.left, *lane.right))):
        return None
    half_width = lane.half_width()
    if half_width.min() < 2.0 or half_width.max() > 3.5:
        return None
    furniture = Furniture(lane, half_width, _GAP_M)
    scattered(rng, furniture, _THINGS, per_m=float(rng.uniform(0.08, 0.25)))
    speed = float(rng.uniform(0.0, _MOST_CURRENT_MPS))
    where = float(rng.uniform(-np.pi, np.pi))
    return Course(
        world="harbour",
        seed=seed,
        route=lane.route,
        half_width=half_width,
        walls=(*lane.left, *lane.right),
        things=tuple(furniture.things),
        lamps=sunlit(rng, lane.route, half_width),
        ceiling_m=0.0,
        gap_m=furniture.gap_m,
        current_mps=(speed * float(np.cos(where)), speed * float(np.sin(where))),
    )
