"""The part of the kernel's Video4Linux2 interface that a webcam with JPEG pictures needs.

Numbers and layouts: <linux/videodev2.h> of a 64-bit kernel, printed by a C program on x86-64; they
are the same on 64-bit ARM, whose kernel has the same sizes and alignments.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

__all__ = [
    "BUFFER_FLAG_ERROR",
    "BUFFER_FLAG_MONOTONIC",
    "BUFFER_FLAG_TIMESTAMP_MASK",
    "CAPTURE",
    "DEQUEUE",
    "MJPEG",
    "QUERY_BUFFER",
    "QUEUE",
    "REQUEST_BUFFERS",
    "SET_FORMAT",
    "SET_PARAMETERS",
    "STREAM_OFF",
    "STREAM_ON",
    "Buffer",
    "frame_rate",
    "image_size",
    "pixel_format",
    "request",
]

SET_FORMAT: Final = 0xC0D05605  # VIDIOC_S_FMT
SET_PARAMETERS: Final = 0xC0CC5616  # VIDIOC_S_PARM
REQUEST_BUFFERS: Final = 0xC0145608  # VIDIOC_REQBUFS
QUERY_BUFFER: Final = 0xC0585609  # VIDIOC_QUERYBUF
QUEUE: Final = 0xC058560F  # VIDIOC_QBUF
DEQUEUE: Final = 0xC0585611  # VIDIOC_DQBUF
STREAM_ON: Final = 0x40045612  # VIDIOC_STREAMON
STREAM_OFF: Final = 0x40045613  # VIDIOC_STREAMOFF

CAPTURE: Final = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
MJPEG: Final = 0x47504A4D  # V4L2_PIX_FMT_MJPEG
BUFFER_FLAG_ERROR: Final = 0x40
BUFFER_FLAG_TIMESTAMP_MASK: Final = 0xE000
BUFFER_FLAG_MONOTONIC: Final = 0x2000

_MEMORY_MMAP: Final = 1
_FIELD_NONE: Final = 1
_BUFFER: Final = struct.Struct("=IIIII4xqq16xIIQIIi4x")  # struct v4l2_buffer, 88 bytes.
_FORMAT: Final = struct.Struct("=I4xIIII184x")  # struct v4l2_format, 208 bytes.
_PARAMETERS: Final = struct.Struct("=I8xII184x")  # struct v4l2_streamparm, 204 bytes.
_REQUEST: Final = struct.Struct("=III8x")  # struct v4l2_requestbuffers, 20 bytes.


@dataclass(frozen=True, slots=True)
class Buffer:
    """What the kernel says of a buffer.

    Attributes:
        index: Its number.
        used: Bytes of the picture in it.
        flags: What it says of its time and of errors.
        at_ns: When the picture was taken.
        offset: Where it is, for mmap.
        length: Its size in bytes.
    """

    index: int
    used: int = 0
    flags: int = 0
    at_ns: int = 0
    offset: int = 0
    length: int = 0

    def pack(self) -> bytearray:
        """As the kernel takes it."""
        seconds, rest_ns = divmod(self.at_ns, 1_000_000_000)
        return bytearray(
            _BUFFER.pack(
                self.index,
                CAPTURE,
                self.used,
                self.flags,
                _FIELD_NONE,
                seconds,
                rest_ns // 1000,
                0,
                _MEMORY_MMAP,
                self.offset,
                self.length,
                0,
                0,
            )
        )

    @classmethod
    def unpack(cls, data: bytes | bytearray) -> Buffer:
        """As the kernel gives it."""
        index, _, used, flags, _, seconds, microseconds, _, _, offset, length, _, _ = (
            _BUFFER.unpack(data)
        )
        at_ns = seconds * 1_000_000_000 + microseconds * 1000
        return cls(index, used, flags, at_ns, offset & 0xFFFFFFFF, length)


def pixel_format(width: int, height: int) -> bytearray:
    """JPEG pictures of a size."""
    return bytearray(_FORMAT.pack(CAPTURE, width, height, MJPEG, _FIELD_NONE))


def image_size(data: bytes | bytearray) -> tuple[int, int, int]:
    """Width, height and pixel format that the camera has taken."""
    _, width, height, kind, _ = _FORMAT.unpack(data)
    return width, height, kind


def frame_rate(fps: float) -> bytearray:
    """So many pictures a second."""
    return bytearray(_PARAMETERS.pack(CAPTURE, 1000, round(fps * 1000)))


def request(buffers: int) -> bytearray:
    """So many buffers."""
    return bytearray(_REQUEST.pack(buffers, CAPTURE, _MEMORY_MMAP))
