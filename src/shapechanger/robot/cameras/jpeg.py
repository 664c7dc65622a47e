"""JPEG frames: validation, rotation and splitting of streams."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

import numpy as np
import simplejpeg

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.cameras.camera import CameraPlan, Frame

_MAX_JPEG: Final = 4 * 1024 * 1024
"""Size of the largest frame, bytes."""

_MAX_SKIPPED: Final = 1 << 20
"""Bytes without a frame after which a stream is taken to have none; several lost frames fit."""


def checked_frame(jpeg: bytes, captured_ns: int, plan: CameraPlan) -> Frame:
    """Return a frame of the camera's size, rotated by 180 degrees if the camera is upside down.

    Header and end of the data are checked; it is decoded only in order to rotate it.
    """
    jpeg = _without_padding(jpeg)
    if len(jpeg) > _MAX_JPEG:
        raise RobotError(f"The camera returned {len(jpeg)} bytes; a frame has at most {_MAX_JPEG}.")
    if not simplejpeg.is_jpeg(jpeg):
        raise RobotError("The camera returned an incomplete JPEG.")
    with translate_errors(ValueError, to=_not_decoded):
        height, width, _, _ = simplejpeg.decode_jpeg_header(jpeg)
    if (int(width), int(height)) != plan.size:
        raise RobotError(
            f"The camera returned a frame of {width} by {height} pixels; "
            f"the profile sets {plan.size[0]} by {plan.size[1]}."
        )
    if not plan.flip:
        return Frame(jpeg, captured_ns)
    with translate_errors(ValueError, to=_not_decoded):
        # Strict: without it, missing blocks would become grey, and the new JPEG would hide that.
        image = simplejpeg.decode_jpeg(jpeg, strict=True)
    upright = np.ascontiguousarray(image[::-1, ::-1])
    encoded = simplejpeg.encode_jpeg(upright, plan.jpeg_quality, colorsubsampling="420")
    return Frame(encoded, captured_ns, encoded_here=True)


def _not_decoded(error: ValueError) -> RobotError:
    return RobotError(f"The camera sent an invalid JPEG that cannot be decoded: {error}.")


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
        self._scan: Iterator[int | None] | None = None  # Of the first frame.
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
        while (length := self._scanned()) is not None:
            jpeg = bytes(self._data[: max(length, 0)])
            if skipped := max(-length, 0) or _start_of_another(jpeg):
                self._skip(skipped)
                continue
            self._drop(length)
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

    def _scanned(self) -> int | None:
        """Continue the scan of the first frame; see `_scan`."""
        if self._scan is None:
            start = self._data.find(_START)
            # Without a start, its first byte may be the last one here.
            self._skip(start if start >= 0 else len(self._data) - self._data.endswith(b"\xff"))
            if start < 0:
                return None
            self._scan = _scan(self._data)
        return next(self._scan)

    def _skip(self, count: int) -> None:
        self.skipped += count
        self._since_frame += count
        self._drop(count)

    def _drop(self, count: int) -> None:
        del self._data[:count]
        self._scan = None


def _scan(data: bytes | bytearray) -> Iterator[int | None]:
    """Scan data that begins with the start of a frame, and grows meanwhile.

    Yields:
        None while more bytes are needed; then the length of the frame, or, negative, the number of
        bytes that are part of no frame.
    """
    at, has_scan = len(_START), False
    while True:
        while len(data) < at + 2:
            yield None
        marker = data[at + 1]
        if data[at] != 0xFF or marker in _NOT_IN_FRAME or (marker == _END and not has_scan):
            yield -len(_START)
        elif marker == _END:
            yield at + 2
        elif marker == 0xFF:
            at += 1
        elif marker in _WITHOUT_LENGTH:
            at += 2
        else:
            while len(data) < at + 4:
                yield None
            length = int.from_bytes(data[at + 2 : at + 4], "big")
            if not 2 <= length <= _LONGEST.get(marker, _LONGEST_TABLE):
                yield -len(_START)
            at += 2 + length
            if marker == _SCAN:
                while (found := _AFTER_SCAN.search(data, at)) is None:
                    at = max(at, len(data) - 1)
                    yield None
                at, has_scan = found.start(), True
                if data[at + 1] == _START[1]:
                    yield -at  # A frame that is cut off, and the next one.


def _start_of_another(jpeg: bytes) -> int:
    """Return where a whole frame begins that ends with these bytes; 0 if they are one frame.

    A segment of a frame that is cut off claims bytes of the next frame, and may end at a marker of
    it. A thumbnail ends before its frame.
    """
    starts = (found.start() for found in _ANOTHER.finditer(jpeg, len(_START)))
    return next((at for at in starts if next(_scan(jpeg[at:])) == len(jpeg) - at), 0)


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
