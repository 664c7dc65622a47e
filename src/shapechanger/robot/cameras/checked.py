"""Whether a picture is one, and a new one."""

from __future__ import annotations

from typing import Final

import simplejpeg

from shapechanger.errors import RobotError

__all__ = ["MAX_JPEG", "FreezeDetector", "check_jpeg"]

MAX_JPEG: Final = 4 * 1024 * 1024
"""Bytes of the largest picture; a larger one is garbage, or a camera set up wrongly."""


def check_jpeg(jpeg: bytes, size: tuple[int, int]) -> None:
    """Make sure that this is a whole JPEG of a size, by its header and its end.

    Args:
        jpeg: What a camera gave.
        size: Width and height in pixels.

    Raises:
        RobotError: If it is something else.
    """
    if len(jpeg) > MAX_JPEG:
        raise RobotError(f"The camera gave {len(jpeg)} bytes; a picture has {MAX_JPEG} at most.")
    if not simplejpeg.is_jpeg(jpeg):
        raise RobotError("The camera gave something that is no whole JPEG.")
    try:
        height, width, _, _ = simplejpeg.decode_jpeg_header(jpeg)
    except ValueError as error:
        raise RobotError(f"The camera gave something that is no JPEG: {error}.") from error
    if (int(width), int(height)) != size:
        raise RobotError(
            f"The camera gave a picture of {width} by {height} pixels; "
            f"the profile says {size[0]} by {size[1]}."
        )


class FreezeDetector:
    """Notices a camera that hands out the same picture again and again.

    The noise of a sensor makes each picture differ. One that is the same to the last byte is not
    new, whatever its time of capture says.
    """

    def __init__(self) -> None:
        self._last = b""

    def is_new(self, jpeg: bytes) -> bool:
        """Whether a picture differs from the one before."""
        new = jpeg != self._last
        self._last = jpeg
        return new
