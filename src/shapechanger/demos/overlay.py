"""Draw the action of a step below its picture."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver, Step
from shapechanger.layout import Layout

COLOURS: Final[dict[Driver, tuple[int, int, int]]] = {
    "person": (0, 114, 178),
    "expert": (0, 158, 115),
    "policy": (230, 159, 0),
    "program": (153, 153, 153),
}
"""Colour of each driver: M. Okabe, K. Ito, "Color universal design", 2008."""

_WIDTH: Final = 480  # Minimum width, pixels.
_BAR: Final = 14  # Height of one bar, pixels.
_BACKGROUND: Final = (24, 28, 34)
_MIDDLE: Final = (110, 118, 128)
_WANTED: Final = (255, 255, 255)


def overlay(picture: NDArray[np.uint8], step: Step, layout: Layout) -> NDArray[np.uint8]:
    """Return a picture with the action of its step below it, one bar per value.

    A bar starts at 0, or at the bound nearest to 0: steering to the left is a bar to the left. Its
    colour shows the driver; a white line shows what a policy wanted while somebody else drove.

    Args:
        picture: Shape (h, w, 3).
        step: The step.
        layout: Layout of its action.

    Returns:
        Shape (H, W, 3) with W at least 480; both sizes are even, as video codecs require.
    """
    times = max(1, math.ceil(_WIDTH / picture.shape[1]))
    large = picture.repeat(times, axis=0).repeat(times, axis=1)
    width = large.shape[1] - large.shape[1] % 2
    large = large[: large.shape[0] - large.shape[0] % 2, :width]
    # The ends of the bars; for an unbounded value its magnitude, at least 1.
    reach = np.maximum(1.0, np.abs(step.action))
    lows = np.where(np.isfinite(layout.low), layout.low, -reach).tolist()
    highs = np.where(np.isfinite(layout.high), layout.high, reach).tolist()
    strips = [
        _strip(
            width,
            _share(value, low, high),
            _share(min(max(0.0, low), high), low, high),
            None if step.wanted is None else _share(step.wanted[place], low, high),
            COLOURS[step.driver],
        )
        for place, (value, low, high) in enumerate(zip(step.action, lows, highs, strict=True))
    ]
    return np.concatenate([large, *strips])


def blank(size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return an empty picture, for episodes without a camera.

    Args:
        size: Width and height in pixels.
    """
    return np.full((size[1], size[0], 3), _BACKGROUND, np.uint8)


def _share(value: float, low: float, high: float) -> float:
    """Return the position of a value between two bounds, from 0 to 1."""
    return 0.5 if not low < high else min(max((value - low) / (high - low), 0.0), 1.0)


def _strip(
    width: int, value: float, zero: float, wanted: float | None, colour: tuple[int, int, int]
) -> NDArray[np.uint8]:
    strip = np.full((_BAR, width, 3), _BACKGROUND, np.uint8)
    last = width - 1
    from_, to = sorted((round(zero * last), round(value * last)))
    strip[2:-2, from_ : to + 1] = colour
    middle = round(zero * last)
    strip[:, middle : middle + 1] = _MIDDLE
    if wanted is not None:
        place = min(round(wanted * last), last - 1)
        strip[1:-1, place : place + 2] = _WANTED
    return strip
