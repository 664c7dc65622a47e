"""JPEG frames: validation, rotation and splitting of streams."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.cameras.camera import CameraPlan, Frame

_MAX_JPEG: Final = 4 * 1024 * 1024
"""Size of the largest frame, bytes."""

_MAX_SKIPPED: Final = 1 << 20
"""Bytes without a frame after which a stream is invalid; several usual frames may be lost."""


def checked_frame(jpeg: bytes, captured_ns: int, plan: CameraPlan) -> Frame:
    """Return a frame of the camera's size, rotated by 180 degrees if the camera is upside down.

    The header and the end of the data are checked; the frame is decoded only to rotate it.
    """
    if not simplejpeg.is_jpeg(jpeg) and len(jpeg) <= _MAX_JPEG:  # Remove padding of some cameras.
        splitter = JpegSplitter()
        splitter.feed(jpeg)
        jpeg = splitter.next() or jpeg
    if len(jpeg) > _MAX_JPEG:
        raise RobotError(f"The camera returned {len(jpeg)} bytes; a frame has at most {_MAX_JPEG}.")
    if not simplejpeg.is_jpeg(jpeg):
        raise RobotError("The camera returned an incomplete JPEG.")
    with translate_errors(
        ValueError,
        to=lambda error: RobotError(
            f"The camera sent an invalid JPEG that cannot be decoded: {error}."
        ),
    ):
        height, width, _, _ = simplejpeg.decode_jpeg_header(jpeg)
        _require_size(int(width), int(height), plan)
        if not plan.flip:
            return Frame(jpeg, captured_ns)
        # Without `strict`, missing blocks would become grey, and the new JPEG would look complete.
        image = simplejpeg.decode_jpeg(jpeg, strict=True)
    return encoded_frame(image[::-1, ::-1], captured_ns, plan)


def encoded_frame(image: NDArray[np.uint8], captured_ns: int, plan: CameraPlan) -> Frame:
    """Encode an image of the camera's size, RGB, shape (height, width, 3), as a frame."""
    _require_size(image.shape[1], image.shape[0], plan)
    jpeg = simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), plan.jpeg_quality, colorsubsampling="420"
    )
    return Frame(jpeg, captured_ns, encoded_here=True)


def _require_size(width: int, height: int, plan: CameraPlan) -> None:
    if (width, height) != plan.size:
        raise RobotError(
            f"The camera returned a frame of {width} by {height} pixels; "
            f"the profile sets {plan.size[0]} by {plan.size[1]}."
        )


_START: Final = b"\xff\xd8"
_END: Final = 0xD9
_SCAN: Final = 0xDA
_NOT_IN_FRAME: Final = (0x00, _START[1])
_WITHOUT_LENGTH: Final = frozenset({0x01, *range(0xD0, 0xD8)})
# End of coded data: FF not followed by a stuffed zero, a restart marker or another FF.
_AFTER_SCAN: Final = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
_ANOTHER: Final = re.compile(rb"\xff\xd8(?=\xff)")
_CAPTURED: Final = re.compile(rb"captured_ns=([0-9]{1,20})")
_COMMENT: Final = 0xFE
# Lengths of segments (ITU-T T.81, B.2): a scan has at most four components; eight Huffman tables of
# 256 codes are the longest tables. Only comments and application data may fill 16 bits.
_LONGEST: Final = dict.fromkeys((*range(0xE0, 0xF0), _COMMENT), 0xFFFF) | {_SCAN: 14}
_LONGEST_TABLE: Final = 2 + 8 * (17 + 256)


class JpegSplitter:
    """Splits a byte stream into JPEG frames.

    A frame is parsed from marker to marker, so that a thumbnail in it, or a marker in a comment,
    does not end it. Bytes outside complete frames are skipped, such as the headers between the
    parts of an HTTP stream, padding, and incomplete frames.
    """

    def __init__(self) -> None:
        self.skipped = 0  # Number of bytes skipped so far.
        self._data = bytearray()
        self._since_frame = 0  # Bytes skipped since the last frame.

    def feed(self, data: bytes) -> None:
        """Append bytes of the stream."""
        self._data += data

    def next(self) -> bytes | None:
        """Return the next complete frame, or None if more bytes are needed.

        More than 1 MiB without a frame raises RobotError; the next call continues after it.
        """
        while True:
            start = self._data.find(_START)
            # Without a start marker, the last byte may be the first byte of one.
            self._skip(start if start >= 0 else len(self._data) - self._data.endswith(b"\xff"))
            if (length := _length(self._data)) is None:
                break
            jpeg = bytes(self._data[: max(length, 0)])
            if skipped := max(-length, 0) or _start_of_another(jpeg):
                self._skip(skipped)
                continue
            del self._data[:length]
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

    def _skip(self, count: int) -> None:
        self.skipped += count
        self._since_frame += count
        del self._data[:count]


def _length(data: bytes | bytearray) -> int | None:
    """Return the length of the frame at the start of the data; None while bytes are missing.

    A negative result is the number of bytes to skip, because they belong to no frame.
    """
    at, has_scan = len(_START), False
    while at + 2 <= len(data):
        marker = data[at + 1]
        if data[at] != 0xFF or marker in _NOT_IN_FRAME or (marker == _END and not has_scan):
            return -len(_START)
        if marker == _END:
            return at + 2
        if marker == 0xFF or marker in _WITHOUT_LENGTH:
            at += 1 if marker == 0xFF else 2
            continue
        if len(data) < at + 4:
            break
        length = int.from_bytes(data[at + 2 : at + 4])
        if not 2 <= length <= _LONGEST.get(marker, _LONGEST_TABLE):
            return -len(_START)
        at += 2 + length
        if marker == _SCAN:
            if (found := _AFTER_SCAN.search(data, at)) is None:
                break
            at, has_scan = found.start(), True
            if data[at + 1] == _START[1]:
                return -at  # The frame is cut off; the next one begins here.
    return None


def _start_of_another(jpeg: bytes) -> int:
    """Return the start of another complete frame that ends where `jpeg` ends; 0 without one.

    If a frame is cut off, the length of its last segment may reach into the next frame, so that
    both look like one. A thumbnail is no such frame, because it ends before the outer frame.
    """
    starts = (found.start() for found in _ANOTHER.finditer(jpeg, len(_START)))
    return next((at for at in starts if _length(jpeg[at:]) == len(jpeg) - at), 0)


def with_capture_time(jpeg: bytes, captured_ns: int) -> bytes:
    """Add the capture time to a JPEG as a comment segment; see `captured_ns_of`."""
    comment = b"captured_ns=%d" % captured_ns
    return _START + bytes((0xFF, _COMMENT)) + (len(comment) + 2).to_bytes(2) + comment + jpeg[2:]


def captured_ns_of(jpeg: bytes) -> int | None:
    """Return the capture time, ns, from a comment segment `captured_ns=<integer>`, or None."""
    at = len(_START)
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF and jpeg[at + 1] != _SCAN:
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4])
        if jpeg[at + 1] == _COMMENT and (found := _CAPTURED.fullmatch(jpeg[at + 4 : end])):
            return int(found[1])
        at = end
    return None
