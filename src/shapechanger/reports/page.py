"""Self-contained HTML pages: templates, and pictures as data URIs."""

from __future__ import annotations

import base64
import functools
import struct
import zlib
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import MissingExtra
from shapechanger.reports.numbers import count

if TYPE_CHECKING:
    from jinja2 import Environment

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
# Bits per channel; RGB; the only compression and filter methods there are; no interlacing.
# Source: ISO/IEC 15948.
_RGB8: Final = bytes([8, 2, 0, 0, 0])
_UP: Final = 2  # The filter that stores each row as its difference from the row above.


def render(template: str, **values: Any) -> str:
    """Render a page from a template in `shapechanger/reports/templates`.

    Values are escaped, except those of type `markupsafe.Markup`.

    Args:
        template: File name, such as "study.html".
        **values: Variables of the template. A missing one is an error.

    Raises:
        MissingExtra: If Jinja2 is not installed.
    """
    return _environment().get_template(template).render(values)


@functools.cache
def _environment() -> Environment:
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined
    except ImportError as error:
        raise MissingExtra("jinja2", "report") from error
    environment = Environment(
        loader=PackageLoader("shapechanger.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    cast("Any", environment).filters["count"] = count
    return environment


def png(picture: NDArray[np.uint8]) -> bytes:
    """Encode a picture, shape (height, width, 3), as a PNG file."""
    height, width, _ = picture.shape
    above = np.concatenate([np.zeros_like(picture[:1]), picture[:-1]])
    rows = (picture - above).reshape(height, -1)  # Bytes wrap around, as the filter requires.
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
    """Lossless data URI of a picture, shape (height, width, 3)."""
    return _uri("image/png", png(picture))


def jpeg_uri(jpeg: bytes) -> str:
    """Data URI of a JPEG file."""
    return _uri("image/jpeg", jpeg)


def svg_uri(svg: str) -> str:
    """Data URI of an SVG drawing; as a separate image, its ids cannot clash with another's."""
    return _uri("image/svg+xml", svg.encode())


def _chunk(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)


def _uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
