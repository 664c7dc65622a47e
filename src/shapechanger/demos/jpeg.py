"""Decode and encode JPEG images, with checks of untrusted ones, and draw actions below them.

simplejpeg is imported on first use, because recordings without images need no decoder.
"""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.demos.episodes import Driver, Step
from shapechanger.errors import DemosError, MissingExtra, translate_errors
from shapechanger.layout import Layout

MAX_PIXELS: Final = 1 << 24
"""Limit of decoded pixels; the header of a JPEG of a few hundred bytes can claim 4 * 10**9."""
_SCAN: Final = b"\xff\xda"  # Start of a scan (ITU-T T.81); in the scans 0xff is followed by 0.
_MAX_SCANS: Final = 64  # Progressive JPEGs have about ten.
_REMEDY: Final = "replace it with an intact copy, or remove it and its entry"


def decode_picture(jpeg: bytes, name: str) -> NDArray[np.uint8]:
    """Decode a JPEG to red, green and blue, shape (height, width, 3); `name` is for errors."""
    picture_size(jpeg, name)
    # Strict by default: a truncated image is an error, instead of being filled with grey.
    return _decoded("decode_jpeg", jpeg, name, colorspace="RGB")


def encode_picture(pixels: NDArray[np.uint8], quality: int = 100) -> bytes:
    """Encode red, green and blue, shape (height, width, 3), as a JPEG of a quality in percent.

    Colours have the full resolution.
    """
    return _simplejpeg().encode_jpeg(
        np.ascontiguousarray(pixels), quality=quality, colorspace="RGB", colorsubsampling="444"
    )


def picture_size(jpeg: bytes, name: str) -> tuple[int, int]:
    """Return the width and height in the header of a JPEG, in pixels, without decoding it."""
    if jpeg.count(_SCAN) > _MAX_SCANS:
        raise DemosError(f"The image {name} has more than {_MAX_SCANS} scans: {_REMEDY}.")
    height, width, *_ = _decoded("decode_jpeg_header", jpeg, name)
    if height * width > MAX_PIXELS:
        claimed = f"{width} x {height} pixels, more than {MAX_PIXELS}"
        raise DemosError(f"The image {name} claims {claimed}: {_REMEDY}.")
    return width, height


def is_grey(jpeg: bytes, name: str) -> bool:
    """Return whether a JPEG has no colours."""
    return _decoded("decode_jpeg_header", jpeg, name)[2] == "Gray"


def _decoded(function: str, jpeg: bytes, name: str, **options: str) -> Any:
    try:
        return getattr(_simplejpeg(), function)(jpeg, **options)
    except ValueError as error:
        if not jpeg:
            raise DemosError(f"The image {name} is empty: {_REMEDY}.") from error
        raise DemosError(
            f"The image {name} is not a JPEG, or is damaged ({error}): {_REMEDY}."
        ) from error


def _simplejpeg() -> Any:
    with translate_errors(ImportError, to=lambda _: MissingExtra("simplejpeg", "data")):
        return import_module("simplejpeg")


# Colour of each driver: M. Okabe, K. Ito, "Color universal design", 2008.
COLOURS: Final[dict[Driver, tuple[int, int, int]]] = {
    "person": (0, 114, 178),
    "expert": (0, 158, 115),
    "policy": (230, 159, 0),
    "program": (153, 153, 153),
}
BACKGROUND: Final = (24, 28, 34)  # Below an image, and in episodes without a camera.
_MIDDLE, _WANTED = (110, 118, 128), (255, 255, 255)
_WIDTH, _BAR = 480, 14  # Minimum width, and height of one bar, pixels.


def overlay(picture: NDArray[np.uint8], step: Step, layout: Layout) -> NDArray[np.uint8]:
    """Return an image with the action of its step below it, one bar per value.

    A bar starts at 0, or at the bound nearest to 0: steering to the left is a bar to the left. Its
    colour shows the driver; a white line shows the action of a policy while another driver drove.
    The image of shape (h, w, 3) becomes at least 480 wide, with even sizes for video codecs.
    """
    times = max(1, math.ceil(_WIDTH / picture.shape[1]))
    large = picture.repeat(times, axis=0).repeat(times, axis=1)
    height, width = (size - size % 2 for size in large.shape[:2])
    reach = np.maximum(1.0, np.abs(step.action))  # Ends of the bars of unbounded values.
    lows = np.where(np.isfinite(layout.low), layout.low, -reach)
    highs = np.where(np.isfinite(layout.high), layout.high, reach)
    lows, highs = lows - (lows == highs), highs + (lows == highs)

    def columns(values: ArrayLike) -> list[int]:
        shares = (np.clip(np.nan_to_num(values), lows, highs) - lows) / (highs - lows)
        return np.rint(shares * (width - 1)).astype(int).tolist()

    bars = np.full((len(lows), _BAR, width, 3), BACKGROUND, np.uint8)
    for bar, zero, end in zip(bars, columns(0.0 * lows), columns(step.action), strict=True):
        bar[2:-2, min(zero, end) : max(zero, end) + 1] = COLOURS[step.driver]
        bar[:, zero] = _MIDDLE
    for bar, place in zip(bars, columns(step.wanted) if step.wanted else (), strict=False):
        bar[1:-1, min(place, width - 2) :][:, :2] = _WANTED
    return np.concatenate([large[:height, :width], *bars])
