"""Small real pictures."""

import numpy as np
import simplejpeg


def grey(value: int) -> bytes:
    """A JPEG of 40 x 30 pixels, all of one grey."""
    return simplejpeg.encode_jpeg(np.full((30, 40, 3), value, np.uint8))
