"""Pictures of any vehicle's camera as one virtual camera would have taken them.

Each vehicle mounts its camera at another angle, and some see their own bonnet. A policy that
learned in one body then meets another horizon in the next. The virtual camera looks level, with the
same field of view for all, and sees no part of the vehicle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import WorldError

__all__ = ["CANONICAL_SIZE", "CameraGeometry", "Rectifier"]

CANONICAL_SIZE: Final = (80, 48)
"""Width and height of a rectified picture, pixels."""

# Focal length of the virtual camera and row of its horizon, pixels: 31 degrees to each side, 18 up,
# and 21 down, where the car's bonnet begins.
_FOCAL: Final = 66.0
_HORIZON: Final = 22.0
_SAMPLES: Final = 3  # In each direction of a pixel.
_MOST_MISSING: Final = 0.15  # Share of the pixels.


@dataclass(frozen=True, slots=True)
class CameraGeometry:
    """How a camera looks at the world.

    Attributes:
        pitch_deg: Angle of the optical axis below the horizon, degrees.
        fovy_deg: Vertical field of view, degrees, above 0 and below 180.
    """

    pitch_deg: float
    fovy_deg: float


class Rectifier:
    """Warps pictures of one camera to the virtual camera.

    A pixel of the virtual camera is a ray; the ray, turned by the pitch, meets a pixel of the real
    camera. Nothing is said about heights: a camera that is mounted higher sees the ground farther
    down, which the policy has to bear.

    Args:
        geometry: The real camera.
        size: Width and height of its pictures, pixels.

    Raises:
        WorldError: If the camera does not see what the virtual camera sees.
    """

    def __init__(self, geometry: CameraGeometry, size: tuple[int, int]) -> None:
        wide, high = size
        columns, rows = CANONICAL_SIZE
        focal = 0.5 * high / math.tan(0.5 * math.radians(geometry.fovy_deg))
        down = math.radians(geometry.pitch_deg)
        # Samples within each pixel; the mean of them is the pixel.
        part = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
        u = (np.arange(columns)[:, None] + part).ravel() - 0.5 * columns
        v = (np.arange(rows)[:, None] + part).ravel() - _HORIZON
        x, y = np.meshgrid(u / _FOCAL, v / _FOCAL)  # Right and down, at a depth of 1.
        depth = y * math.sin(down) + math.cos(down)
        column = np.floor(focal * x / depth + 0.5 * wide).astype(np.intp)
        row = np.floor(focal * (y * math.cos(down) - math.sin(down)) / depth + 0.5 * high)
        row = row.astype(np.intp)
        missing = np.mean((column < 0) | (column >= wide) | (row < 0) | (row >= high))
        if missing > _MOST_MISSING:
            raise WorldError(
                f"A camera that looks {geometry.pitch_deg:g} degrees down with a vertical field "
                f"of view of {geometry.fovy_deg:g} degrees misses {100 * missing:.0f} % of what "
                "policies for all vehicles look at, which is 18 degrees above the horizon to 21 "
                "below, and 31 to each side."
            )
        places = np.clip(row, 0, high - 1) * wide + np.clip(column, 0, wide - 1)
        shape = (rows, _SAMPLES, columns, _SAMPLES)
        self._places = places.reshape(shape).transpose(1, 3, 0, 2).reshape(-1, rows * columns)
        self._shape = (high, wide, 3)

    def __call__(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a picture as the virtual camera would have taken it.

        Args:
            picture: Shape (height, width, 3).

        Returns:
            Shape (48, 80, 3). What the camera does not see repeats the nearest pixel.

        Raises:
            WorldError: If the picture has another size.
        """
        if picture.shape != self._shape:
            raise WorldError(
                f"The pictures of this camera have the shape {self._shape}, got {picture.shape}."
            )
        pixels = picture.reshape(-1, 3)
        total = np.zeros((self._places.shape[1], 3), np.uint16)
        for places in self._places:
            total += pixels[places]
        mean = (total + self._places.shape[0] // 2) // self._places.shape[0]
        return mean.astype(np.uint8).reshape(CANONICAL_SIZE[1], CANONICAL_SIZE[0], 3)
