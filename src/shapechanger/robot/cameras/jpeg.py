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

_MAX_SKIPPED: Final = 1 << 20
"""Bytes without a frame after which a stream is taken to have none; several lost frames fit."""


def check_jpeg(jpeg: bytes, size: tuple[int, int]) -> None:
    """Check that a frame is a complete JPEG of the expected size, from its header and its end."""
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
    """
    jpeg = _without_padding(jpeg)
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
# Lengths of segments (ITU-T T.81, B.2): a scan has at most four components; eight Huffman tables of
# 256 codes are the longest tables. Only comments and application data may fill 16 bits.
_LONGEST: Final = dict.fromkeys((*range(0xE0, 0xF0), _COMMENT), 0xFFFF) | {_SCAN: 14}
_LONGEST_TABLE: Final = 2 + 8 * (17 + 256)


class JpegSplitter:
    """Split a byte stream into JPEG frames.

    A frame is followed from marker to marker, so that a thumbnail in it, or a marker in a comment,
    does not end it. Bytes that are part of no frame are skipped: the headers between the parts of
    an HTTP stream, padding, a frame that was cut off.

    Attributes:
        skipped: Number of bytes skipped so far.
    """

    def __init__(self) -> None:
        self.skipped = 0
        self._data = bytearray()
        self._at = 0  # Position up to which the first frame has been scanned.
        self._in_scan = False
        self._has_scan = False
        self._since_frame = 0  # Bytes skipped since the last frame.

    def feed(self, data: bytes) -> None:
        """Append bytes."""
        self._data += data

    def next(self) -> bytes | None:
        """Return the next complete frame, or None if more bytes are needed.

        Raises:
            RobotError: If there is more than 1 MiB without a frame; the next call continues after
                it.
        """
        while True:
            if not self._at:
                start = self._data.find(_START)
                # Without a start, its first byte may be the last one here.
                self._skip(start if start >= 0 else len(self._data) - self._data.endswith(b"\xff"))
            if (part := self._scan()) is not None:
                count, is_frame = part
                if not is_frame:
                    self._skip(count)
                    continue
                jpeg = bytes(self._data[:count])
                if whole := _start_of_another(jpeg):
                    self._skip(whole)
                    continue
                self._drop(count)
                self._since_frame = 0
                return jpeg
            if len(self._data) > _MAX_JPEG:
                self._skip(len(self._data))
            if self._since_frame > _MAX_SKIPPED:
                without, self._since_frame = self._since_frame, 0
                raise RobotError(
                    f"The stream has {without} bytes without a complete JPEG of at most "
                    f"{_MAX_JPEG} bytes: send MJPEG."
                )
            return None

    def _scan(self) -> tuple[int, bool] | None:
        """Return the length of the first frame and True, or how many bytes to skip and False.

        None if more bytes are needed.
        """
        data = self._data
        self._at = self._at or (len(_START) if len(data) >= len(_START) else 0)
        while self._at and self._at + 2 <= len(data):
            if self._in_scan:
                found = _AFTER_SCAN.search(data, self._at)
                if found is None:
                    self._at = len(data) - 1
                    return None
                self._at, self._in_scan, self._has_scan = found.start(), False, True
                if data[self._at + 1] == _START[1]:
                    return self._at, False  # A frame that is cut off, and the next one.
            marker = data[self._at + 1]
            if data[self._at] != 0xFF or (marker == _END and not self._has_scan):
                return len(_START), False
            if marker == _END:
                return self._at + 2, True
            if marker == 0xFF:
                self._at += 1
            elif marker in _WITHOUT_LENGTH:
                self._at += 2
            elif self._at + 4 > len(data):
                return None
            else:
                length = int.from_bytes(data[self._at + 2 : self._at + 4], "big")
                longest = _LONGEST.get(marker, _LONGEST_TABLE)
                if not 2 <= length <= longest or marker in (0x00, _START[1]):
                    return len(_START), False
                if self._at + 2 + length > len(data):
                    return None
                self._at += 2 + length
                self._in_scan = marker == _SCAN
        return None

    def _skip(self, count: int) -> None:
        self.skipped += count
        self._since_frame += count
        self._drop(count)

    def _drop(self, count: int) -> None:
        del self._data[:count]
        self._at, self._in_scan, self._has_scan = 0, False, False


def _start_of_another(jpeg: bytes) -> int:
    """Return where a whole frame begins that ends with these bytes; 0 if they are one frame.

    A segment of a frame that is cut off claims bytes of the next frame, and may end at a marker of
    it. A thumbnail ends before its frame.
    """
    start = jpeg.find(_START + b"\xff", len(_START))
    while start > 0:
        splitter = JpegSplitter()
        splitter.feed(jpeg[start:])
        if splitter._scan() == (len(jpeg) - start, True):  # pyright: ignore[reportPrivateUsage]
            return start
        start = jpeg.find(_START + b"\xff", start + 1)
    return 0


def _without_padding(data: bytes) -> bytes:
    """Return the first frame in the data of a camera, which may pad it; the data without one."""
    if simplejpeg.is_jpeg(data):
        return data
    splitter = JpegSplitter()
    splitter.feed(data)
    return data if len(data) > _MAX_JPEG else splitter.next() or data


def captured_ns_of(jpeg: bytes) -> int | None:
    """Return the time in a comment segment `captured_ns=<integer>`, or None."""
    at = len(_START)
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF and jpeg[at + 1] != _SCAN:
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        if jpeg[at + 1] == _COMMENT and (found := _CAPTURED.fullmatch(jpeg[at + 4 : end])):
            return int(found[1])
        at = end
    return None
