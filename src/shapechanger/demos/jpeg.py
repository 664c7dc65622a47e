"""JPEG pictures of unknown origin: checked before they are decoded, and stored unchanged.

simplejpeg is imported on first use, because recordings without pictures need no decoder.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import DemosError, MissingExtra

MAX_PIXELS: Final = 1 << 24
"""Limit of decoded pixels, about sixteen million. The header of a JPEG of a few hundred bytes can
claim four thousand million."""

_SCAN: Final = b"\xff\xda"  # Start of a scan (ITU-T T.81); in the scans 0xff is followed by 0.
_MAX_SCANS: Final = 64  # Progressive JPEGs have about ten.
_GREY: Final = "Gray"
_REMEDY: Final = "replace it with an intact copy, or remove it and its entry"


def decode_picture(jpeg: bytes, name: str, *, grey: bool = False) -> NDArray[np.uint8]:
    """Decode a JPEG.

    Args:
        jpeg: Its bytes.
        name: How to name the picture in errors.
        grey: Whether to decode the brightness only.

    Returns:
        Red, green and blue, shape (height, width, 3); shape (height, width) with `grey`.

    Raises:
        DemosError: If the picture is damaged, or larger than `MAX_PIXELS`.
        MissingExtra: If simplejpeg is not installed.
    """
    picture_size(jpeg, name)
    try:
        # Strict by default: a truncated picture is an error, not filled up with grey.
        pixels = _simplejpeg().decode_jpeg(jpeg, colorspace="GRAY" if grey else "RGB")
    except ValueError as error:
        raise DemosError(f"The picture {name} is damaged ({error}): {_REMEDY}.") from error
    return pixels[..., 0] if grey else pixels


def encode_picture(pixels: NDArray[np.uint8], quality: int = 100) -> bytes:
    """Encode pixels as a JPEG with full colour resolution.

    Args:
        pixels: Red, green and blue, shape (height, width, 3).
        quality: JPEG quality in percent.

    Raises:
        MissingExtra: If simplejpeg is not installed.
    """
    return _simplejpeg().encode_jpeg(
        np.ascontiguousarray(pixels), quality=quality, colorspace="RGB", colorsubsampling="444"
    )


def picture_size(jpeg: bytes, name: str) -> tuple[int, int]:
    """Return the width and height in the header of a JPEG, in pixels, without decoding it.

    Args:
        jpeg: Its bytes.
        name: How to name the picture in errors.

    Raises:
        DemosError: If the data is not a JPEG, or claims more than `MAX_PIXELS`.
        MissingExtra: If simplejpeg is not installed.
    """
    if jpeg.count(_SCAN) > _MAX_SCANS:
        raise DemosError(
            f"The picture {name} has more than {_MAX_SCANS} scans, each of which takes the time of "
            f"a picture: {_REMEDY}."
        )
    height, width, _ = _header(jpeg, name)
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The picture {name} claims {width} x {height} pixels, more than the limit of "
            f"{MAX_PIXELS}: {_REMEDY}."
        )
    return width, height


def is_grey(jpeg: bytes, name: str) -> bool:
    """Return whether a JPEG has no colours; errors are those of `picture_size`.

    Args:
        jpeg: Its bytes.
        name: How to name the picture in errors.
    """
    return _header(jpeg, name)[2] == _GREY


def _header(jpeg: bytes, name: str) -> tuple[int, int, str]:
    """Return the height, width and colour space of a JPEG."""
    try:
        height, width, colours, _ = _simplejpeg().decode_jpeg_header(jpeg)
    except ValueError as error:
        what = f"is not a JPEG, or is damaged ({error})" if jpeg else "is empty"
        raise DemosError(f"The picture {name} {what}: {_REMEDY}.") from error
    return height, width, colours


def _simplejpeg() -> Any:
    try:
        import simplejpeg
    except ImportError as error:
        raise MissingExtra("simplejpeg", "data") from error
    return simplejpeg
