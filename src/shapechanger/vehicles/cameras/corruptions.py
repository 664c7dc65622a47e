"""Camera faults: pure functions on images, for bad light and a bad lens.

They change images only, never the world, to test how well policies generalize to other images.
All take and return images of shape (H, W, 3), uint8, of any size.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from shapechanger.errors import UnknownName

Picture = NDArray[np.uint8]

Corruption = Callable[[Picture, int], Picture]
"""Function from an image and a seed, >= 0 and constant within an episode, to an image."""

# Share of the brightness that is left at night in red, green and blue, after the camera has raised
# its gain as far as it can, and a gamma that darkens shadows. A quarter of the light without any
# gain made images with a mean of 13 of 255, in which a person saw nothing.
_NIGHT_SHARE: Final = (0.46, 0.5, 0.66)
_NIGHT_GAMMA: Final = 1.1
# Standard deviation of a small sensor's noise at that gain, of 255 levels.
_NIGHT_NOISE: Final = 9.0
# Levels that glare adds, of 255, in its middle, and everywhere as a veil.
_GLARE_PEAK: Final = 230.0
_GLARE_VEIL: Final = 28.0
# Standard deviation of the blur over the width: 2 pixels of 160.
_BLUR: Final = 0.0125
# Number of spots on a dirty lens, their radius over the width, and the share of light they absorb.
_SPOTS: Final = (8, 14)
_SPOT_RADIUS: Final = (0.02, 0.085)
_SPOT_DEPTH: Final = (0.45, 0.85)
_DIRT: Final = np.array([52.0, 46.0, 34.0], np.float32)
# Noise is cut from one long strip, because drawing it for each image would dominate the time. It
# has this length, or twice the image's.
_STRIP: Final = 1 << 19
_KEPT: Final = 64


def night(picture: Picture, seed: int) -> Picture:
    """Halve the brightness of an image, bluish, with a raised gain's noise of 9 levels."""
    dark = np.empty(picture.shape, np.float32)
    for channel, table in enumerate(_night_tables()):
        dark[..., channel] = table[picture[..., channel]]
    dark += _NIGHT_NOISE * _noise(picture, seed)
    return _bytes(dark)


def glare(picture: Picture, seed: int) -> Picture:
    """Add light shining into the lens from the upper half of an image: up to 230 levels."""
    added = _glare(seed, *picture.shape[:2])
    return _bytes(picture + added)


def blur(picture: Picture, seed: int) -> Picture:
    """Defocus an image by 1.25 % of its width; the seed has no effect."""
    del seed
    variance = (_BLUR * picture.shape[1]) ** 2
    # Two box filters over w = 2 r + 1 pixels have the variance 2 (w^2 - 1) / 12 = 2 (r^2 + r) / 3.
    reach = max(1, round(0.5 * (np.sqrt(6.0 * variance + 1.0) - 1.0)))
    result, size = picture.astype(np.float64), (2 * reach + 1, 2 * reach + 1, 1)
    for _ in range(2):
        result = uniform_filter(result, size, mode="nearest")
    return _bytes(result)


def dirt(picture: Picture, seed: int) -> Picture:
    """Add 8 to 14 spots of mud, at places of the seed, that absorb 45 to 85 % of the light."""
    keeps, mud = _dirt(seed, *picture.shape[:2])
    return _bytes(picture * keeps + mud)


CORRUPTIONS: Final[Mapping[str, Corruption]] = MappingProxyType(
    {"night": night, "glare": glare, "blur": blur, "dirt": dirt}
)
"""Camera faults, keyed by name."""


def find_corruption(name: str) -> Corruption:
    """Find a camera fault by name."""
    if name not in CORRUPTIONS:
        raise UnknownName("lens", name, CORRUPTIONS)
    return CORRUPTIONS[name]


def _bytes(levels: NDArray[np.floating[Any]]) -> Picture:
    """Levels rounded and clipped to 0 to 255; `levels` is overwritten."""
    levels += 0.5
    return np.clip(levels, 0.0, 255.0, out=levels).astype(np.uint8)


@functools.cache
def _night_tables() -> tuple[NDArray[np.float32], ...]:
    level = np.linspace(0.0, 1.0, 256)
    return tuple((255.0 * s * level**_NIGHT_GAMMA).astype(np.float32) for s in _NIGHT_SHARE)


@functools.lru_cache(4)
def _strip(length: int) -> NDArray[np.float32]:
    return np.random.default_rng(20_26).standard_normal(length, np.float32)


def _noise(picture: Picture, seed: int) -> NDArray[np.float32]:
    """Standard normal noise of the image's shape, a function of the seed and the image."""
    # Different images nearly always have different sums.
    mixed = (int(picture.sum(dtype=np.int64)) * 2_654_435_761 + seed * 40_503) & 0xFFFF_FFFF
    strip = _strip(max(_STRIP, 2 * picture.size))
    start = mixed % (strip.size - picture.size)
    return strip[start : start + picture.size].reshape(picture.shape)


@functools.lru_cache(_KEPT)
def _glare(seed: int, height: int, width: int) -> NDArray[np.float32]:
    """Levels that the glare of a seed adds, (H, W, 3)."""
    rng = np.random.default_rng([seed, 1])
    x, y = rng.uniform(0.15, 0.85) * width, rng.uniform(0.05, 0.4) * height
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    away = np.hypot(columns - x, rows - y) / width
    spot = np.exp(-((away / rng.uniform(0.09, 0.16)) ** 2))
    halo = np.exp(-away / 0.3)
    # A horizontal streak, as from a smeared or cheap lens.
    streak = np.exp(-(((rows - y) / (0.015 * width)) ** 2)) * halo
    light = _GLARE_PEAK * np.minimum(1.0, spot + 0.45 * halo + 0.3 * streak) + _GLARE_VEIL
    return (light[..., None] * np.array([1.0, 0.97, 0.86])).astype(np.float32)


@functools.lru_cache(_KEPT)
def _dirt(seed: int, height: int, width: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Transmittance of a seed's dirt, (H, W, 1), and the light it adds, (H, W, 3)."""
    rng = np.random.default_rng([seed, 2])
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    keeps = np.ones((height, width), np.float32)
    for _ in range(int(rng.integers(_SPOTS[0], _SPOTS[1] + 1))):
        x, y = rng.uniform(0.0, width), rng.uniform(0.0, height)
        radius, depth = rng.uniform(*_SPOT_RADIUS) * width, rng.uniform(*_SPOT_DEPTH)
        across, down = (columns - x) / rng.uniform(0.8, 1.3), rows - y
        # Dirt on the lens is out of focus, so it has soft edges.
        soft = np.clip(1.5 - np.hypot(across, down) / radius, 0.0, 1.0)
        keeps *= 1.0 - np.float32(depth) * soft
    keeps = keeps[..., None]
    return keeps, (1.0 - keeps) * _DIRT
