"""Grain that repeats without a seam, from which all textures are made."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Field", "blend", "clouds", "grain"]

Field = NDArray[np.floating[Any]]
"""A picture (H, W, 3) or one of its channels (H, W); single precision where it is large."""


def clouds(
    rng: np.random.Generator, height: int, width: int, rows: int, columns: int, octaves: int = 3
) -> Field:
    """Soft random patches, shape (height, width), mean 0, standard deviation 1.

    It repeats without a seam in both directions. `rows` and `columns` are how many patches fit
    into it; each further octave has twice as many, half as strong.
    """
    total = np.zeros((height, width), np.float32)
    for octave in range(octaves):
        down, across = min(rows << octave, height), min(columns << octave, width)
        knots = rng.standard_normal((down, across)).astype(np.float32)
        total += _stretch(_stretch(knots, height).T, width).T * np.float32(0.5**octave)
    return (total - total.mean()) / (total.std() + np.float32(1e-6))


def grain(rng: np.random.Generator, height: int, width: int) -> Field:
    """Each pixel on its own, shape (height, width), mean 0, standard deviation 1."""
    return rng.standard_normal((height, width), np.float32)


def blend(ground: Field, colour: tuple[float, float, float], share: Field | float) -> Field:
    """`ground` (H, W, 3) with `share` (H, W), from 0 to 1, of a colour painted over it."""
    over = np.asarray(share, np.float32)[..., None]
    return ground + over * (np.asarray(colour, np.float32) - ground)


def _stretch(knots: Field, size: int) -> Field:
    """Columns of `knots` (k, n) drawn out to (size, n), smoothly and round the edge."""
    count = len(knots)
    place = np.arange(size, dtype=np.float32) * np.float32(count / size)
    below = place.astype(np.intp)
    part = place - below
    smooth = (part * part * (3.0 - 2.0 * part))[:, None].astype(np.float32)
    return knots[below % count] * (1.0 - smooth) + knots[(below + 1) % count] * smooth
