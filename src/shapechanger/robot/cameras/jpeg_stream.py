"""Cuts a stream of JPEG pictures into pictures.

A JPEG is a row of segments: FF, a marker and, except for a few, a length. After the segment "start
of scan" come bytes in which FF is followed by 00 or a restart marker, until the next marker.
Source: ITU-T T.81, annex B.
"""

from __future__ import annotations

import re
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.checked import MAX_JPEG

__all__ = ["JpegSplitter", "captured_ns_of"]

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
