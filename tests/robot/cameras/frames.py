"""Frames, and a reader of the barcode in the test pattern and in a twin's frames."""

import binascii

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from shapechanger.robot.cameras.sources import barcode_rows


def read_barcode(image: NDArray[np.uint8]) -> int | None:
    """Return the number in the first rows of an image of shape (height, width, 3), or None."""
    height, width = image.shape[:2]
    rows = barcode_rows(width)
    if width < 96 or height < rows:
        return None
    cells = image[:rows, : 32 * (width // 32)].reshape(2, rows // 2, 32, width // 32, -1)
    data = np.packbits(cells.mean(axis=(1, 3, 4)) > 127.5).tobytes()
    if binascii.crc_hqx(data[:6], 0xFFFF) != int.from_bytes(data[6:], "big"):
        return None
    return int.from_bytes(data[:6], "big")


def jpeg_of(value: int = 0, size: tuple[int, int] = (32, 24)) -> bytes:
    """Return a uniformly grey JPEG of a size (width, height)."""
    image = np.full((size[1], size[0], 3), value, np.uint8)
    return simplejpeg.encode_jpeg(image, 80, colorsubsampling="420")


def with_comment(jpeg: bytes, comment: bytes) -> bytes:
    return jpeg[:2] + b"\xff\xfe" + (len(comment) + 2).to_bytes(2, "big") + comment + jpeg[2:]
