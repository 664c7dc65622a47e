"""Small JPEG images."""

import numpy as np
import simplejpeg


def grey(value: int) -> bytes:
    """Return a uniform grey JPEG of 40 x 30 pixels."""
    return simplejpeg.encode_jpeg(np.full((30, 40, 3), value, np.uint8))
