"""Pictures as data URIs, so that a page needs no other file."""

from __future__ import annotations

import base64
import struct
import zlib
from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["png", "png_uri", "svg_uri"]

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
# Bits of a channel; red, green and blue; then the only compression and filter there are; no
# interlacing. Source of the format: ISO/IEC 15948.
_RGB8: Final = bytes([8, 2, 0, 0, 0])
_UP: Final = 2  # The filter that keeps of each row what differs from the row above.


def png(picture: NDArray[np.uint8]) -> bytes:
    """A picture, shape (height, width, 3), as a PNG file."""
    height, width, _ = picture.shape
    above = np.concatenate([np.zeros_like(picture[:1]), picture[:-1]])
    rows = (picture - above).reshape(height, -1)  # Bytes wrap around, as the filter wants it.
    filters = np.full((height, 1), _UP, np.uint8)
    return b"".join(
        (
            _SIGNATURE,
            _chunk(b"IHDR", struct.pack(">II", width, height) + _RGB8),
            _chunk(b"IDAT", zlib.compress(np.hstack([filters, rows]).tobytes(), 9)),
            _chunk(b"IEND", b""),
        )
    )


def png_uri(picture: NDArray[np.uint8]) -> str:
    """A picture, shape (height, width, 3), without loss."""
    return _uri("image/png", png(picture))


def svg_uri(svg: str) -> str:
    """A drawing; as an image of its own, so that the ids of two drawings do not meet."""
    return _uri("image/svg+xml", svg.encode())


def _chunk(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)


def _uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
