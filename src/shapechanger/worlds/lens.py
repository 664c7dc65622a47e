"""What a camera makes of a picture: other light and a worse lens, each as a pure function.

They shift pictures only, never the world: a policy that drives well through all of them does not
cling to how its training looked. All take and give pictures of shape (H, W, 3), uint8.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import UnknownName

__all__ = ["LENSES", "Lens", "Picture", "blur", "dirt", "expose", "glare", "lens", "night"]

Picture = NDArray[np.uint8]

Lens = Callable[[Picture, int], Picture]
"""From a picture and a seed, an int >= 0 that stays the same for an episode, to a picture."""

# Light that is left at night: a quarter, of which dark parts keep less (a gamma), and more blue.
_NIGHT_SHARE: Final = (0.24, 0.25, 0.34)
_NIGHT_GAMMA: Final = 1.25
# Standard deviation of a small sensor's noise when it is turned up at night, of 255.
_NIGHT_NOISE: Final = 5.0
# Glare adds up to this, of 255, at its middle, and a veil over all.
_GLARE_PEAK: Final = 230.0
_GLARE_VEIL: Final = 28.0
# Standard deviation of the blur as a share of the width: 2 pixels of 160.
_BLUR: Final = 0.0125
# Spots on a dirty lens, their radius as a share of the width, and how much light they take.
_SPOTS: Final = (8, 14)
_SPOT_RADIUS: Final = (0.02, 0.085)
_SPOT_DEPTH: Final = (0.45, 0.85)
_DIRT: Final = np.array([52.0, 46.0, 34.0], np.float32)
# Noise is cut from one long strip, because drawing it anew takes longer than all the rest.
_STRIP: Final = 1 << 19
_KEPT: Final = 64


def night(picture: Picture, seed: int) -> Picture:
    """A quarter of the light, bluish, with a noise of 5 levels that is another in each picture."""
    dark = np.empty(picture.shape, np.float32)
    for channel, table in enumerate(_night_tables()):
        dark[..., channel] = table[picture[..., channel]]
    dark += _NIGHT_NOISE * _noise(picture, seed)
    return _bytes(dark)


def glare(picture: Picture, seed: int) -> Picture:
    """A light that shines into the lens from somewhere above the middle: up to 230 levels more."""
    added = _glare(seed, *picture.shape[:2])
    return _bytes(picture + added)


def blur(picture: Picture, seed: int) -> Picture:
    """Out of focus by 1.25 % of the width; the seed changes nothing."""
    del seed
    variance = (_BLUR * picture.shape[1]) ** 2
    # Two averages over w pixels have the variance 2 (w^2 - 1) / 12 = 2 (r^2 + r) / 3.
    reach = max(1, round(0.5 * (np.sqrt(6.0 * variance + 1.0) - 1.0)))
    result = picture.astype(np.float32)
    for axis in (0, 0, 1, 1):
        result = _summed(result, reach, axis)
    result *= np.float32((2 * reach + 1) ** -4)
    return _bytes(result)


def dirt(picture: Picture, seed: int) -> Picture:
    """8 to 14 spots of mud that take 45 to 85 % of the light; a seed always has the same."""
    keeps, mud = _dirt(seed, *picture.shape[:2])
    return _bytes(picture * keeps + mud)


def expose(picture: Picture, gain: float, noise: float, rng: np.random.Generator) -> Picture:
    """The picture with its light multiplied and the sensor's noise added.

    Args:
        picture: What the lens lets through.
        gain: Factor on all levels, > 0; 1 changes nothing.
        noise: Standard deviation, of 255 levels, >= 0.
        rng: What the noise follows from.
    """
    result = picture * np.float32(gain)
    if noise > 0.0:
        start = int(rng.integers(_STRIP - picture.size))
        result += np.float32(noise) * _strip()[start : start + picture.size].reshape(picture.shape)
    return _bytes(result)


LENSES: Final[Mapping[str, Lens]] = MappingProxyType(
    {"night": night, "glare": glare, "blur": blur, "dirt": dirt}
)
"""The shifts of a picture by name."""


def lens(name: str) -> Lens:
    """The shift of that name.

    Raises:
        UnknownName: If there is none.
    """
    try:
        return LENSES[name]
    except KeyError:
        raise UnknownName("lens", name, LENSES) from None


def _bytes(levels: NDArray[np.float32]) -> Picture:
    """Levels of 0 to 255, rounded, with what is outside cut off; `levels` is used up."""
    levels += 0.5
    return np.clip(levels, 0.0, 255.0, out=levels).astype(np.uint8)


@functools.cache
def _night_tables() -> tuple[NDArray[np.float32], ...]:
    level = np.linspace(0.0, 1.0, 256)
    return tuple((255.0 * s * level**_NIGHT_GAMMA).astype(np.float32) for s in _NIGHT_SHARE)


@functools.cache
def _strip() -> NDArray[np.float32]:
    return np.random.default_rng(20_26).standard_normal(_STRIP, np.float32)


def _noise(picture: Picture, seed: int) -> NDArray[np.float32]:
    """Noise of the picture's shape that follows from the seed and the picture, deviation 1."""
    # Any two pictures of a drive differ, so their sums nearly always do.
    mixed = (int(picture.sum(dtype=np.int64)) * 2_654_435_761 + seed * 40_503) & 0xFFFF_FFFF
    start = mixed % (_STRIP - picture.size)
    return _strip()[start : start + picture.size].reshape(picture.shape)


def _summed(picture: NDArray[np.float32], reach: int, axis: int) -> NDArray[np.float32]:
    """Each pixel as the sum of those up to `reach` away along an axis; the edge goes on outside."""
    pads = [(0, 0)] * picture.ndim
    pads[axis] = (reach, reach)
    padded = np.pad(picture, pads, mode="edge")
    size = picture.shape[axis]
    total = np.zeros_like(picture)
    for shift in range(2 * reach + 1):
        total += padded[shift : shift + size] if axis == 0 else padded[:, shift : shift + size]
    return total


@functools.lru_cache(_KEPT)
def _glare(seed: int, height: int, width: int) -> NDArray[np.float32]:
    """What the glare of a seed adds, (H, W, 3)."""
    rng = np.random.default_rng([seed, 1])
    x, y = rng.uniform(0.15, 0.85) * width, rng.uniform(0.05, 0.4) * height
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    away = np.hypot(columns - x, rows - y) / width
    spot = np.exp(-((away / rng.uniform(0.09, 0.16)) ** 2))
    halo = np.exp(-away / 0.3)
    # A streak along the rows, as a smeared window or a cheap lens draws it.
    streak = np.exp(-(((rows - y) / (0.015 * width)) ** 2)) * halo
    light = _GLARE_PEAK * np.minimum(1.0, spot + 0.45 * halo + 0.3 * streak) + _GLARE_VEIL
    return (light[..., None] * np.array([1.0, 0.97, 0.86])).astype(np.float32)


@functools.lru_cache(_KEPT)
def _dirt(seed: int, height: int, width: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What the dirt of a seed lets through (H, W, 1), and what it shows instead (H, W, 3)."""
    rng = np.random.default_rng([seed, 2])
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    keeps = np.ones((height, width), np.float32)
    for _ in range(int(rng.integers(_SPOTS[0], _SPOTS[1] + 1))):
        x, y = rng.uniform(0.0, width), rng.uniform(0.0, height)
        radius, depth = rng.uniform(*_SPOT_RADIUS) * width, rng.uniform(*_SPOT_DEPTH)
        across, down = (columns - x) / rng.uniform(0.8, 1.3), rows - y
        # What sits on the lens is out of focus: it has no edge.
        soft = np.clip(1.5 - np.hypot(across, down) / radius, 0.0, 1.0)
        keeps *= 1.0 - np.float32(depth) * soft
    keeps = keeps[..., None]
    return keeps, (1.0 - keeps) * _DIRT
