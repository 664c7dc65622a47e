"""JPEG frames: validation, freeze detection, rotation and splitting of streams."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
import simplejpeg

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame

_MAX_JPEG: Final = 4 * 1024 * 1024
"""Size of the largest frame, bytes."""


def check_jpeg(jpeg: bytes, size: tuple[int, int]) -> None:
    """Check that a frame is a complete JPEG of the expected size, by its header and its end.

    Args:
        jpeg: The frame.
        size: Width and height in pixels.

    Raises:
        RobotError: If it is not.
    """
    if len(jpeg) > _MAX_JPEG:
        raise RobotError(f"The camera returned {len(jpeg)} bytes; a frame has at most {_MAX_JPEG}.")
    if not simplejpeg.is_jpeg(jpeg):
        raise RobotError("The camera returned an incomplete JPEG.")
    try:
        height, width, _, _ = simplejpeg.decode_jpeg_header(jpeg)
    except ValueError as error:
        raise RobotError(f"The camera returned invalid JPEG data: {error}.") from error
    if (int(width), int(height)) != size:
        raise RobotError(
            f"The camera returned a frame of {width} by {height} pixels; "
            f"the profile sets {size[0]} by {size[1]}."
        )


class FreezeDetector:
    """Detect a camera that repeats its last frame.

    Sensor noise makes frames differ, so a frame with the same bytes is not new, whatever its time
    of capture.
    """

    def __init__(self) -> None:
        self._last = b""

    def is_new(self, jpeg: bytes) -> bool:
        """Return whether the frame differs from the previous one."""
        new = jpeg != self._last
        self._last = jpeg
        return new


def checked_frame(jpeg: bytes, captured_ns: int, plan: CameraPlan) -> Frame:
    """Return a frame of the camera's size, rotated by 180 degrees if the camera is upside down.

    The data is decoded only in order to rotate it.

    Args:
        jpeg: Data from a camera.
        captured_ns: Time of capture, ns.
        plan: Settings of the camera.

    Raises:
        RobotError: If the data is not a complete JPEG of that size, or cannot be decoded to rotate
            it.
    """
    check_jpeg(jpeg, plan.size)
    if not plan.flip:
        return Frame(jpeg, captured_ns)
    try:
        # Strict: without it, missing blocks would become grey, and the new JPEG would hide that.
        image = simplejpeg.decode_jpeg(jpeg, strict=True)
    except ValueError as error:
        raise RobotError(f"The camera sent a JPEG that cannot be decoded: {error}.") from error
    upright = np.ascontiguousarray(image[::-1, ::-1])
    encoded = simplejpeg.encode_jpeg(upright, plan.jpeg_quality, colorsubsampling="420")
    return Frame(encoded, captured_ns, encoded_here=True)


_START: Final = b"\xff\xd8"
_END: Final = 0xD9
_SCAN: Final = 0xDA
_WITHOUT_LENGTH: Final = frozenset({0x01, *range(0xD0, 0xD8)})
# End of coded data: FF not followed by a stuffed zero, a restart marker or another FF.
_AFTER_SCAN: Final = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
_CAPTURED: Final = re.compile(rb"captured_ns=([0-9]{1,20})")
_COMMENT: Final = 0xFE


class JpegSplitter:
    """Split a byte stream into JPEG frames."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._at = 0  # Position up to which the first frame has been scanned.
        self._in_scan = False

    def feed(self, data: bytes) -> None:
        """Append bytes."""
        self._data += data

    def next(self) -> bytes | None:
        """Return the next complete frame, or None if more bytes are needed.

        Raises:
            RobotError: If there is garbage; the next call continues after it.
        """
        garbage = self._skip_to_start()
        if garbage:
            raise RobotError(f"The stream has {garbage} bytes that are not part of a JPEG.")
        try:
            end = self._find_end()
        except ValueError as error:
            self._drop(len(_START))
            raise RobotError(f"The stream has an invalid JPEG: {error}.") from error
        if end is None:
            if len(self._data) > _MAX_JPEG:
                self._drop(len(self._data))
                raise RobotError(f"The stream has a JPEG of more than {_MAX_JPEG} bytes.")
            return None
        jpeg = bytes(self._data[:end])
        self._drop(end)
        return jpeg

    def _skip_to_start(self) -> int:
        if self._at:
            return 0
        start = self._data.find(_START)
        if start < 0:
            # Its first byte may have arrived already.
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
    """Return the time in a comment segment `captured_ns=<integer>`, or None."""
    at = len(_START)
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF and jpeg[at + 1] != _SCAN:
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if jpeg[at + 1] == _COMMENT and (found := _CAPTURED.fullmatch(jpeg[at + 4 : end])):
            return int(found[1])
        at = end
    return None
