"""Turns pictures of a camera that hangs upside down."""

from __future__ import annotations

import numpy as np
import simplejpeg

__all__ = ["turned"]


def turned(jpeg: bytes, quality: int) -> bytes:
    """The picture turned by 180 degrees; it is decoded and encoded again.

    Args:
        jpeg: A whole JPEG, see `check_jpeg`.
        quality: 1 to 100.
    """
    image = simplejpeg.decode_jpeg(jpeg, strict=False)
    upright = np.ascontiguousarray(image[::-1, ::-1])
    return simplejpeg.encode_jpeg(upright, quality, colorsubsampling="420")
