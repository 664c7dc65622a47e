"""Ray-cast images of a straight corridor, with the actions of a driver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# A camera a few centimetres above the floor with a field of view of 90 degrees across.
_EYE = 0.1
_WIDTH, _HEIGHT = 2.0, 2.5
_SLOW_BELOW = 4.0  # m to the wall at the end.


@dataclass(frozen=True)
class Drive:
    """Demonstrations.

    Attributes:
        pictures: Shape (n, height, width, 3).
        actions: Steering and throttle, shape (n, 2).
    """

    pictures: NDArray[np.uint8]
    actions: NDArray[np.float32]


def drive(
    n: int,
    seed: int,
    *,
    size: tuple[int, int] = (48, 80),
    light: tuple[float, float] = (0.3, 0.6),
    gain: float = 1.0,
    noise: float = 4.0,
) -> Drive:
    """Return demonstrations from n poses in n corridors.

    Args:
        n: Number of images.
        seed: Seed of poses, colours and noise.
        size: Rows and columns.
        light: Range of the brightness.
        gain: Steering gain; another vehicle needs more, or less.
        noise: Standard deviation of pixel noise, in steps of 256.
    """
    rng = np.random.default_rng(seed)
    aside = rng.uniform(-0.7, 0.7, n)  # m to the left of the middle.
    turned = rng.uniform(-0.5, 0.5, n)  # rad to the left of the corridor.
    ahead = rng.uniform(1.5, 12.0, n)  # m to the end.
    pictures = np.empty((n, *size, 3), np.uint8)
    for i in range(n):
        picture = _look(aside[i], turned[i], ahead[i], size, rng)
        seen = rng.uniform(*light) * picture + rng.normal(0.0, noise, picture.shape)
        pictures[i] = np.clip(seen, 0, 255)
    # Right of the middle and looking right needs left, which is negative.
    steering = np.clip(gain * (1.2 * turned + 0.8 * aside), -1.0, 1.0)
    throttle = np.where(ahead < _SLOW_BELOW, 0.2, 0.8) - 0.3 * np.abs(steering)
    return Drive(pictures, np.stack((steering, throttle), axis=1).astype(np.float32))


def _look(
    aside: float, turned: float, ahead: float, size: tuple[int, int], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Render one image at full light."""
    height, width = size
    left = 1.0 - 2.0 * (np.arange(width) + 0.5) / width
    up = (1.0 - 2.0 * (np.arange(height) + 0.5) / height) * height / width + 0.1
    x = np.cos(turned) - left * np.sin(turned)
    y = np.sin(turned) + left * np.cos(turned)
    # Rays parallel to a plane meet it far away.
    to_end = np.where(x > 1e-6, ahead / np.maximum(x, 1e-6), 1e6)
    to_side = (np.sign(y) * _WIDTH / 2.0 - aside) / np.where(np.abs(y) < 1e-6, 1e-6, y)
    to_wall = np.minimum(to_end, np.abs(to_side))
    far = np.where(up > 0.0, _HEIGHT - _EYE, _EYE) / np.maximum(np.abs(up), 1e-6)
    along = x * to_wall
    flat = far[:, None] < to_wall[None, :]
    high = _EYE + up[:, None] * to_wall[None, :]

    wall, floor, door = (rng.uniform(80, 255, 3) for _ in range(3))
    pitch, phase = rng.uniform(2.0, 5.0), rng.uniform(0.0, 5.0)
    is_door = (np.mod(along + phase, pitch) < 0.9) & (to_wall < to_end)
    upright = np.where(is_door[None, :, None] & (high < 2.0)[:, :, None], door, wall)
    upright = np.where((high < 0.1)[:, :, None], 0.4 * wall, upright)  # The skirting board.
    shade = np.where(to_wall < to_end, 1.0, 0.6)
    ground = np.where(up > 0.0, 1.1, 0.7)[:, None, None] * floor
    return np.where(flat[:, :, None], ground, upright * shade[None, :, None])
