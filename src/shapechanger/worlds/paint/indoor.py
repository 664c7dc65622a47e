"""Walls, doors and the floor of a building: pictures of shape (H, W, 3), 0 to 1, upright."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.paint.noise import Field, blend, clouds, grain

__all__ = ["board", "brick", "ceiling", "door", "floor", "glass", "panel", "plaster", "window"]

_SIZE: Final = 256
_TALL: Final = 512
# Height of what is painted on a wall's texture from the floor up, as a share of the wall's 2.4 m.
_SKIRTING: Final = 0.05
_DARK: Final = (0.24, 0.22, 0.16)
_FRAME: Final = (0.24, 0.22, 0.19)
_STEEL: Final = (0.75, 0.75, 0.72)


def _plain(colour: tuple[float, float, float], height: int, width: int) -> Field:
    return np.tile(np.asarray(colour, np.float32), (height, width, 1))


def plaster(rng: np.random.Generator) -> Field:
    """A painted wall, 2.4 m high, with a dark skirting board; sockets and a notice on some."""
    height, width = _SIZE, _SIZE
    hue = np.array([0.83, 0.79, 0.62]) + rng.uniform(-0.05, 0.05, 3)
    image = _plain((float(hue[0]), float(hue[1]), float(hue[2])), height, width)
    image *= 1.0 + 0.03 * clouds(rng, height, width, 2, 3)[..., None]
    up = np.linspace(1.0, 0.0, height, dtype=np.float32)[:, None, None]
    image *= 0.86 + 0.14 * up  # Brighter towards the lamps.
    if rng.random() < 0.7:
        x = int(rng.integers(10, width - 20))
        image[int(height * 0.84) : int(height * 0.88), x : x + 5] *= 0.62
    if rng.random() < 0.8:
        x = int(rng.integers(10, width - 50))
        top, bottom = int(height * 0.28), int(height * 0.5)
        image[top:bottom, x : x + 34] = _FRAME
        image[top + 3 : bottom - 3, x + 3 : x + 31] = rng.uniform(0.45, 0.9, 3)
        image[top + 8 : bottom - 12, x + 8 : x + 26] *= rng.uniform(0.5, 1.1)
    edge = int(height * (1.0 - _SKIRTING))
    image[edge:] = np.asarray(_DARK, np.float32) * rng.uniform(0.8, 1.7)
    image[edge : edge + 2] *= 1.5  # The edge of the board catches the light.
    image[-2:] *= 0.5
    return image


def panel(rng: np.random.Generator) -> Field:
    """A wall clad in orange wood, with the skirting board of the others."""
    image = plaster(rng) * np.asarray((0.92, 0.62, 0.40), np.float32)
    image *= 1.0 + 0.04 * clouds(rng, _SIZE, _SIZE, 2, 40, 2)[..., None]
    image[:, ::64] *= 0.8
    return image


def door(rng: np.random.Generator) -> Field:
    """A wooden door in its frame, 2.1 m high, with a handle and a kick plate or a small window."""
    height, width = _TALL, _SIZE
    hue = np.array([0.46, 0.26, 0.12]) * rng.uniform(0.75, 1.25) + rng.uniform(-0.04, 0.04, 3)
    image = _plain((float(hue[0]), float(hue[1]), float(hue[2])), height, width)
    image *= 1.0 + 0.10 * clouds(rng, height, width, 2, 24, 2)[..., None]
    if rng.random() < 0.5:  # Panels.
        for top, bottom in ((0.10, 0.42), (0.52, 0.88)):
            rows = slice(int(top * height), int(bottom * height))
            image[rows, 60:196] *= 0.82
            image[rows, 60:64] *= 0.6
            image[rows, 192:196] *= 1.25
    if rng.random() < 0.4:
        image[60:220, 165:195] = (0.10, 0.12, 0.11)
        image[60:220, 165:168] = _STEEL
    if rng.random() < 0.4:
        image[int(0.86 * height) : -4, 34:222] = np.asarray(_STEEL, np.float32) * 0.8
    image[int(0.54 * height) : int(0.57 * height), 48:66] = _STEEL
    image[int(0.50 * height) : int(0.62 * height), 46:54] = _STEEL
    frame = np.asarray(_FRAME, np.float32) * rng.uniform(0.7, 1.6)
    image[:, :24] = image[:, -24:] = image[:26] = frame
    image[:, 24:28] = image[:, -28:-24] = image[26:30] = 0.04
    image[:, 20:24] *= 1.4
    image[-5:] = 0.03
    return image


def window(rng: np.random.Generator) -> Field:
    """Tall panes with the night behind them, and what little they mirror."""
    height, width = _SIZE, _SIZE
    image = _plain((0.035, 0.04, 0.04), height, width)
    glint = np.clip(clouds(rng, height, width, 6, 4), 0.0, 3.0)
    image += 0.03 * glint[..., None]
    for _ in range(4):
        y, x = int(rng.integers(10, 150)), int(rng.integers(20, 220))
        image[y : y + 3, x : x + 12] += rng.uniform(0.2, 0.6)
    bar = np.asarray((0.62, 0.62, 0.55), np.float32)
    for row in (0.0, 0.3, 0.62, 0.9):
        image[int(row * height) : int(row * height) + 6] = bar
    for column in (0.0, 0.5):
        image[:, int(column * width) : int(column * width) + 6] = bar
    image[int(0.93 * height) :] = _DARK
    return image


def brick(rng: np.random.Generator) -> Field:
    """Courses of red brick, 12 of them, each half a brick further on than the one below."""
    height, width, rows, columns = _SIZE, _SIZE, 24, 5
    y = np.arange(height)[:, None] * rows / height
    x = np.arange(width)[None, :] * columns / width + 0.5 * (y.astype(int) % 2)
    number = y.astype(int) * columns + x.astype(int) % columns
    shade = rng.uniform(0.65, 1.2, rows * columns).astype(np.float32)[number]
    image = np.asarray((0.58, 0.26, 0.14), np.float32) * shade[..., None]
    image *= 1.0 + 0.10 * grain(rng, height, width)[..., None]
    joint = ((y % 1.0) < 0.14) | ((x % 1.0) < 0.05)
    return blend(image, (0.62, 0.55, 0.42), joint.astype(np.float32))


def board(rng: np.random.Generator) -> Field:
    """A whiteboard on a painted wall, with something left on it."""
    image, height, width = plaster(rng), _SIZE, _SIZE
    top, bottom = int(0.14 * height), int(0.62 * height)
    image[top - 3 : bottom + 3, 12:-12] = np.asarray(_STEEL, np.float32) * 0.7
    image[top:bottom, 16:-16] = (0.86, 0.88, 0.82)
    for _ in range(7):
        y, x = int(rng.integers(top + 6, bottom - 6)), int(rng.integers(24, width - 90))
        length = int(rng.integers(20, 70))
        image[y : y + 2, x : x + length] = rng.uniform(0.1, 0.6, 3)
    return image


def glass(rng: np.random.Generator) -> Field:
    """A partition of glass in steel: dim, a little green, brighter above."""
    height, width = _SIZE, _SIZE
    image = _plain((0.30, 0.36, 0.32), height, width)
    up = np.linspace(1.3, 0.6, height, dtype=np.float32)[:, None, None]
    image *= up * (1.0 + 0.08 * clouds(rng, height, width, 1, 5)[..., None])
    image[:8] = image[-10:] = image[:, :6] = image[:, -6:] = np.asarray(_STEEL, np.float32) * 0.6
    return image


def floor(rng: np.random.Generator) -> Field:
    """Polished concrete, 3 m wide: blotches, specks and a few scratches."""
    height, width = _TALL, _TALL
    hue = np.array([0.56, 0.54, 0.42]) + rng.uniform(-0.04, 0.04, 3)
    image = _plain((float(hue[0]), float(hue[1]), float(hue[2])), height, width)
    image *= 1.0 + 0.10 * clouds(rng, height, width, 5, 5, 4)[..., None]
    image *= 1.0 + 0.05 * grain(rng, height, width)[..., None]
    image *= 1.0 - 0.12 * np.clip(clouds(rng, height, width, 3, 3, 5), 0.0, 2.0)[..., None]
    return image


def ceiling(rng: np.random.Generator) -> Field:
    """Pale tiles in a grid, 0.6 m each."""
    height, width = _SIZE, _SIZE
    image = _plain((0.60, 0.58, 0.46), height, width)
    image *= 1.0 + 0.05 * grain(rng, height, width)[..., None]
    image[::64] *= 0.7
    image[:, ::64] *= 0.7
    return image
