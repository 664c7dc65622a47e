"""What stands and lies under the open sky: pictures of shape (H, W, 3), 0 to 1, upright."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.paint.noise import Field, blend, clouds, grain

__all__ = ["asphalt", "fence", "grass", "hedge", "quay", "rock", "shed", "water"]

_SIZE: Final = 256
_GROUND: Final = 512


def hedge(rng: np.random.Generator) -> Field:
    """Leaves, darker below and between the twigs."""
    leaves = clouds(rng, _SIZE, _SIZE, 24, 24, 3)
    image = np.asarray((0.20, 0.34, 0.10), np.float32) * (1.0 + 0.32 * leaves[..., None])
    image *= 1.0 + 0.18 * clouds(rng, _SIZE, _SIZE, 3, 4, 2)[..., None]
    image = blend(image, (0.45, 0.52, 0.18), np.clip(leaves - 1.2, 0.0, 1.0) * 0.6)
    up = np.linspace(1.15, 0.55, _SIZE, dtype=np.float32)[:, None, None]
    return image * up


def fence(rng: np.random.Generator) -> Field:
    """Upright planks with gaps, eight of them, and a rail behind."""
    planks = 8
    wide = _SIZE // planks
    shade = np.repeat(rng.uniform(0.75, 1.15, planks).astype(np.float32), wide)
    image = np.asarray((0.56, 0.43, 0.29), np.float32) * shade[None, :, None]
    image = image * (1.0 + 0.10 * clouds(rng, _SIZE, _SIZE, 2, 48, 2)[..., None])
    image[:, np.arange(_SIZE) % wide < 3] = (0.10, 0.09, 0.06)
    for row in (0.2, 0.75):
        image[int(row * _SIZE) : int(row * _SIZE) + 3] *= 0.7
    image[-14:] *= 0.6
    return image


def shed(rng: np.random.Generator) -> Field:
    """Boards that lie flat, painted, with a plinth."""
    hue = np.array([(0.50, 0.16, 0.11), (0.25, 0.34, 0.42), (0.42, 0.40, 0.33)][rng.integers(3)])
    image = np.tile(hue.astype(np.float32), (_SIZE, _SIZE, 1))
    image *= 1.0 + 0.07 * clouds(rng, _SIZE, _SIZE, 40, 3, 2)[..., None]
    image[np.arange(_SIZE) % 16 < 2] *= 0.55
    image[-20:] = (0.34, 0.33, 0.31)
    return image


def quay(rng: np.random.Generator) -> Field:
    """Blocks of stone, pale above and green and wet below."""
    rows, columns = 4, 3
    y = np.arange(_SIZE)[:, None] * rows / _SIZE
    x = np.arange(_SIZE)[None, :] * columns / _SIZE + 0.5 * (y.astype(int) % 2)
    number = y.astype(int) * columns + x.astype(int) % columns
    shade = rng.uniform(0.82, 1.12, rows * columns).astype(np.float32)[number]
    image = np.asarray((0.60, 0.57, 0.51), np.float32) * shade[..., None]
    image *= 1.0 + 0.09 * clouds(rng, _SIZE, _SIZE, 10, 10, 3)[..., None]
    joint = ((y % 1.0) < 0.05) | ((x % 1.0) < 0.03)
    image = blend(image, (0.25, 0.24, 0.21), joint.astype(np.float32))
    edge = 0.70 + 0.04 * clouds(rng, 1, _SIZE, 1, 8, 2)
    down = np.linspace(0.0, 1.0, _SIZE, dtype=np.float32)[:, None]
    return blend(image, (0.13, 0.17, 0.10), np.clip((down - edge) * 8.0, 0.0, 0.85))


def rock(rng: np.random.Generator) -> Field:
    """Rough grey stone with a dark foot."""
    rough = clouds(rng, _SIZE, _SIZE, 5, 5, 4)
    image = np.asarray((0.42, 0.40, 0.37), np.float32) * (1.0 + 0.24 * rough[..., None])
    up = np.linspace(1.1, 0.55, _SIZE, dtype=np.float32)[:, None, None]
    return image * up


def asphalt(rng: np.random.Generator) -> Field:
    """A worn lane, 3 m wide: stones, patches, leaves blown over it."""
    image = np.tile(np.asarray((0.40, 0.39, 0.37), np.float32), (_GROUND, _GROUND, 1))
    image *= 1.0 + 0.11 * clouds(rng, _GROUND, _GROUND, 4, 4, 4)[..., None]
    image *= 1.0 + 0.13 * grain(rng, _GROUND, _GROUND)[..., None]
    cracks = np.abs(clouds(rng, _GROUND, _GROUND, 4, 4, 3)) < 0.025
    image = blend(image, (0.16, 0.16, 0.15), cracks.astype(np.float32) * 0.8)
    leaves = clouds(rng, _GROUND, _GROUND, 64, 64, 1) > 2.4
    return blend(image, (0.42, 0.30, 0.12), leaves.astype(np.float32))


def grass(rng: np.random.Generator) -> Field:
    """Short grass with bare patches."""
    image = np.tile(np.asarray((0.30, 0.42, 0.15), np.float32), (_SIZE, _SIZE, 1))
    image *= 1.0 + 0.22 * clouds(rng, _SIZE, _SIZE, 40, 40, 2)[..., None]
    bare = np.clip(clouds(rng, _SIZE, _SIZE, 3, 3, 3) - 0.6, 0.0, 1.0)
    return blend(image, (0.42, 0.36, 0.22), bare * 0.7)


def water(rng: np.random.Generator) -> Field:
    """Green water, 4 m wide, with ripples that lie across."""
    ripples = clouds(rng, _GROUND, _GROUND, 24, 10, 3)
    image = np.asarray((0.20, 0.32, 0.33), np.float32) * (1.0 + 0.20 * ripples[..., None])
    image *= 1.0 + 0.10 * clouds(rng, _GROUND, _GROUND, 3, 3, 2)[..., None]
    return blend(image, (0.75, 0.82, 0.84), np.clip(ripples - 1.6, 0.0, 1.0) * 0.5)
