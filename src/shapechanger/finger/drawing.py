"""What frames of a finger show besides its model: a legend of the tendons, paths and trails."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from shapechanger.finger.visuals import TENDON_COLOURS

# Narrower frames have no legend, pixels: its names would not be legible.
_NARROWEST: Final = 240
_SMALLEST_FONT: Final = 9.0
# Height of the font over that of the frame. With the bars, the legend stays above a raised finger.
_FONT: Final = 1.0 / 36.0
_INK: Final = (40, 40, 40)
_EMPTY: Final = (205, 210, 218)


def tendon_legend(frame: NDArray[np.uint8], pulled: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return a frame with the name, colour and tension of each tendon along its top.

    Args:
        frame: The frame, (height, width, 3).
        pulled: Tension of each tendon over its largest, 0 to 1, (7,), shown as a bar.
    """
    height, width = frame.shape[:2]
    if width < _NARROWEST:
        return frame
    picture = Image.fromarray(frame)
    draw = ImageDraw.Draw(picture)
    size = max(_SMALLEST_FONT, _FONT * height)
    font = ImageFont.load_default(size)
    gap, column = 0.4 * size, width / len(TENDON_COLOURS)
    bar = column - 2.0 * gap
    top, bottom = gap + 1.2 * size, gap + 1.75 * size
    for i, (name, colour) in enumerate(TENDON_COLOURS.items()):
        left = i * column + gap
        draw.text((left, 0.5 * gap), name, fill=_INK, font=font)
        draw.rectangle((left, top, left + bar, bottom), fill=_EMPTY)
        filled = bar * float(np.clip(pulled[i], 0.0, 1.0))
        paint = tuple(round(255 * part) for part in colour)
        draw.rectangle((left, top, left + filled, bottom), fill=paint)
    return np.array(picture)


def polyline(
    points: NDArray[np.float64], radius: float, rgba: tuple[float, float, float, float]
) -> list[dict[str, Any]]:
    """Return markers of Gymnasium's viewers that connect points.

    Args:
        points: The points, m, (n, 3).
        radius: Radius of the line, m.
        rgba: Red, green, blue and opacity, 0 to 1.
    """
    markers: list[dict[str, Any]] = []
    for start, end in pairwise(points):
        along = end - start
        length = float(np.linalg.norm(along))
        if length <= 0.0:
            continue
        turn, axes = np.empty(4), np.empty(9)
        mujoco.mju_quatZ2Vec(turn, along / length)
        mujoco.mju_quat2Mat(axes, turn)
        markers.append(
            {
                "type": mujoco.mjtGeom.mjGEOM_CAPSULE,
                "pos": 0.5 * (start + end),
                "size": np.array([radius, radius, 0.5 * length]),
                "mat": axes,
                "rgba": np.array(rgba),
            }
        )
    return markers
