"""The sky as six square pictures, and its image in still water below."""

from __future__ import annotations

from typing import Final

import numpy as np

from shapechanger.worlds.paint.noise import Field, clouds

__all__ = ["sky"]

_SIZE: Final = 64
_ZENITH: Final = np.array([0.36, 0.55, 0.82], np.float32)
_HORIZON: Final = np.array([0.80, 0.86, 0.90], np.float32)
# Where the middle of each face is, in the order in which MuJoCo takes them, and where its columns
# and its rows, from the last to the first, run to. Found by drawing: as seen from within, columns
# run to the left.
_FACES: Final = (
    ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
    ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    ((0, 1, 0), (-1, 0, 0), (0, 0, 1)),
)


def sky(rng: np.random.Generator) -> Field:
    """Shape (6 * size, size, 3), 0 to 1: blue above, pale at the horizon, mirrored below it."""
    across = (np.arange(_SIZE, dtype=np.float32) + 0.5) * (2.0 / _SIZE) - 1.0
    field = clouds(rng, 256, 256, 4, 4, 5)
    cover = rng.uniform(-0.3, 0.9)
    faces: list[Field] = []
    for ahead, right, up in np.asarray(_FACES, np.float32):
        rays = ahead + across[None, :, None] * right - across[:, None, None] * up
        rays /= np.linalg.norm(rays, axis=2, keepdims=True)
        height = np.abs(rays[..., 2])  # What is below the horizon is the image in the water.
        image = _HORIZON + (_ZENITH - _HORIZON) * np.sqrt(height)[..., None]
        # A layer of clouds, seen from below; 40 pixels of the field are its height.
        place = rays[..., :2] / np.maximum(height, 0.08)[..., None] * 40.0
        column, row = (np.mod(place[..., i], 256).astype(np.intp) for i in (0, 1))
        share = np.clip(field[row, column] * 0.5 + cover, 0.0, 1.0)
        share = share * np.clip(height * 4.0, 0.0, 1.0) * 0.8
        faces.append(image + share[..., None] * (0.92 - image))
    return np.concatenate(faces)
