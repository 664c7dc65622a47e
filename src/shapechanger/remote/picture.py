"""From the JPEG of a robot to the picture of an observation."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import LinkError, MissingExtra

try:
    import simplejpeg  # pyright: ignore[reportMissingTypeStubs]  # Typed, but for its arrays.
except ImportError as error:
    raise MissingExtra("simplejpeg", "remote") from error

__all__ = ["decoded", "resized"]

# Pixels. A few bytes of JPEG can claim a picture of 65,535 x 65,535, which is 12 GB.
_MOST_PIXELS: Final = 4096 * 4096


def decoded(jpeg: bytes) -> NDArray[np.uint8]:
    """The picture, RGB, shape (height, width, 3).

    Raises:
        LinkError: If these bytes are no picture, or one too large to be meant.
    """
    try:
        height, width = (int(n) for n in simplejpeg.decode_jpeg_header(jpeg)[:2])
        if height * width > _MOST_PIXELS:
            raise LinkError(f"A picture of {width} x {height} pixels is too large.")
        return simplejpeg.decode_jpeg(jpeg, colorspace="RGB")
    except ValueError as error:
        raise LinkError(f"The robot sent bytes that are no JPEG: {error}.") from None


def resized(picture: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """The picture at another size, without a library for it.

    Where width and height shrink by whole numbers, each pixel is the mean of its box, rounded.
    Otherwise each is the pixel nearest to its middle. The whole picture is kept, so a change of
    proportions stretches it.

    Args:
        picture: Shape (height, width, 3).
        size: Width and height in pixels, each at least 1.

    Returns:
        Shape (size[1], size[0], 3); the picture itself where the size is its own.
    """
    height, width = picture.shape[:2]
    wide, high = size
    if (width, height) == (wide, high):
        return picture
    if width % wide == 0 and height % high == 0:
        boxes = picture.reshape(high, height // high, wide, width // wide, 3)
        return np.rint(boxes.mean(axis=(1, 3))).astype(np.uint8)
    rows = (2 * np.arange(high) + 1) * height // (2 * high)
    columns = (2 * np.arange(wide) + 1) * width // (2 * wide)
    return picture[rows[:, None], columns[None, :]]
