"""What a low camera at the vehicle's front sees, by one ray for each column of pixels."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.twin.world.room import Room

__all__ = ["FrontCamera"]

FIELD_OF_VIEW: Final = math.radians(90.0)  # From the left edge of the picture to the right one.
CAMERA_HEIGHT: Final = 0.12  # m above the floor
WALL_HEIGHT: Final = 0.4  # m
STRIPE: Final = 0.25  # m: width of the stripes on walls
FADE: Final = 4.0  # m at which a wall has lost 63 % of its light

_CEILING: Final = np.array((205.0, 210.0, 215.0), np.float32)
_FLOOR: Final = np.array((120.0, 95.0, 70.0), np.float32)
_WALLS: Final = np.array(
    (
        (220, 70, 60),
        (70, 150, 220),
        (235, 190, 60),
        (90, 180, 90),
        (180, 90, 190),
        (230, 130, 50),
        (80, 190, 190),
        (200, 200, 200),
    ),
    np.float32,
)


class FrontCamera:
    """Draws the room from where the vehicle is.

    Args:
        size: Width and height of the pictures in pixels.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        width, height = size
        self._focal = (width / 2) / math.tan(FIELD_OF_VIEW / 2)  # In pixels.
        columns = (np.arange(width) + 0.5 - width / 2) / self._focal
        self._angles = -np.arctan(columns)  # The first column is to the left.
        self._lengths = np.hypot(1.0, columns)  # Of a ray whose share along the heading is 1.
        self._rows = (np.arange(height) + 0.5 - height / 2)[:, np.newaxis].astype(np.float32)
        # Light falls off towards the horizon, on the floor and on the ceiling.
        near = np.abs(self._rows) / (height / 2)
        below = self._rows > 0
        background = np.where(
            below[..., np.newaxis],
            _FLOOR * (0.55 + 0.45 * near[..., np.newaxis]),
            _CEILING * (0.8 + 0.2 * near[..., np.newaxis]),
        )
        self._background = np.ascontiguousarray(
            np.broadcast_to(background, (height, width, 3)).astype(np.uint8)
        )

    def picture(self, room: Room, x: float, y: float, heading: float) -> NDArray[np.uint8]:
        """A picture, RGB, shape (height, width, 3)."""
        angles = heading + self._angles
        directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)
        directions *= self._lengths[:, np.newaxis]  # So that distances are along the heading.
        distance, segment, along = room.cast(x, y, directions)
        distance = np.maximum(distance, 0.02).astype(np.float32)
        top = -self._focal * (WALL_HEIGHT - CAMERA_HEIGHT) / distance
        bottom = self._focal * CAMERA_HEIGHT / distance
        light = 0.25 + 0.75 * np.exp(-distance / np.float32(FADE))
        light *= np.where((along // STRIPE) % 2 == 0, 1.0, 0.72).astype(np.float32)
        colours = (_WALLS[segment % len(_WALLS)] * light[:, np.newaxis]).astype(np.uint8)
        wall = (self._rows >= top) & (self._rows < bottom)  # (height, width)
        return np.where(wall[..., np.newaxis], colours, self._background)
