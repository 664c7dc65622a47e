"""Whether a picture is one, and a new one."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
import simplejpeg

from shapechanger.errors import RobotError

__all__ = ["MAX_JPEG", "FreezeDetector", "JpegSplitter", "captured_ns_of", "check_jpeg", "turned"]

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


def turned(jpeg: bytes, quality: int) -> bytes:
    """The picture turned by 180 degrees; it is decoded and encoded again.

    Args:
        jpeg: A whole JPEG, see `check_jpeg`.
        quality: 1 to 100.
    """
    image = simplejpeg.decode_jpeg(jpeg, strict=False)
    upright = np.ascontiguousarray(image[::-1, ::-1])
    return simplejpeg.encode_jpeg(upright, quality, colorsubsampling="420")


_START: Final = b"\xff\xd8"
_END: Final = 0xD9
_SCAN: Final = 0xDA
_WITHOUT_LENGTH: Final = frozenset({0x01, *range(0xD0, 0xD8)})
# Where coded bytes end: FF and neither a stuffed zero, a restart marker nor another FF.
_AFTER_SCAN: Final = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
_CAPTURED: Final = re.compile(rb"captured_ns=([0-9]{1,20})")
_COMMENT: Final = 0xFE


class JpegSplitter:
    """Takes bytes as they come, gives whole pictures."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._at = 0  # How far the picture at the start has been looked through.
        self._in_scan = False

    def feed(self, data: bytes) -> None:
        """Add bytes."""
        self._data += data

    def next(self) -> bytes | None:
        """The next whole picture; None until more bytes come.

        Raises:
            RobotError: If there is garbage; the next call goes on after it.
        """
        garbage = self._skip_to_start()
        if garbage:
            raise RobotError(f"The stream has {garbage} bytes that belong to no JPEG.")
        try:
            end = self._find_end()
        except ValueError as error:
            self._drop(len(_START))
            raise RobotError(f"The stream has a broken JPEG: {error}.") from error
        if end is None:
            if len(self._data) > MAX_JPEG:
                self._drop(len(self._data))
                raise RobotError(f"The stream has a JPEG of more than {MAX_JPEG} bytes.")
            return None
        jpeg = bytes(self._data[:end])
        self._drop(end)
        return jpeg

    def _skip_to_start(self) -> int:
        if self._at:
            return 0
        start = self._data.find(_START)
        if start < 0:
            # Its first byte may be there already.
            start = len(self._data) - int(self._data.endswith(b"\xff"))
        del self._data[:start]
        return start

    def _find_end(self) -> int | None:
        data = self._data
        self._at = self._at or (len(_START) if len(data) >= len(_START) else 0)
        while self._at and self._at + 2 <= len(data):
            if self._in_scan:
                found = _AFTER_SCAN.search(data, self._at)
                if found is None:
                    self._at = len(data) - 1
                    return None
                self._at, self._in_scan = found.start(), False
            if data[self._at] != 0xFF:
                raise ValueError(f"no marker at byte {self._at}")
            marker = data[self._at + 1]
            if marker == _END:
                return self._at + 2
            if marker == 0xFF:
                self._at += 1
            elif marker in _WITHOUT_LENGTH:
                self._at += 2
            elif self._at + 4 > len(data):
                return None
            else:
                length = int.from_bytes(data[self._at + 2 : self._at + 4], "big")
                if length < 2 or marker in (0x00, 0xD8):
                    raise ValueError(f"no segment at byte {self._at}")
                if self._at + 2 + length > len(data):
                    return None
                self._at += 2 + length
                self._in_scan = marker == _SCAN
        return None

    def _drop(self, count: int) -> None:
        del self._data[:count]
        self._at, self._in_scan = 0, False


def captured_ns_of(jpeg: bytes) -> int | None:
    """The time of capture in a comment segment `captured_ns=<whole number>`; None without one."""
    at = len(_START)
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF and jpeg[at + 1] != _SCAN:
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if jpeg[at + 1] == _COMMENT and (found := _CAPTURED.fullmatch(jpeg[at + 4 : end])):
            return int(found[1])
        at = end
    return None
