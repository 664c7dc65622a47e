"""Camera driver for a JPEG webcam over Video4Linux2.

Tested against a fake of the kernel's calls only, not on a camera.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame, Interruption
from shapechanger.robot.cameras.jpeg import checked_frame

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
    """State of a kernel buffer (struct v4l2_buffer).

    Attributes:
        index: Number of the buffer.
        used: Size of its frame, bytes.
        flags: Kind of its timestamp, and errors.
        at_ns: Time of capture, ns.
        offset: Offset for mmap.
        length: Size of the buffer, bytes.
    """

    index: int
    used: int = 0
    flags: int = 0
    at_ns: int = 0
    offset: int = 0
    length: int = 0

    def pack(self) -> bytearray:
        """Encode for the kernel."""
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
        """Decode from the kernel."""
        index, _, used, flags, _, seconds, microseconds, _, _, offset, length, _, _ = (
            _BUFFER.unpack(data)
        )
        at_ns = seconds * 1_000_000_000 + microseconds * 1000
        return cls(index, used, flags, at_ns, offset & 0xFFFFFFFF, length)


def pixel_format(width: int, height: int) -> bytearray:
    """Return a request for JPEG frames of a size.

    Args:
        width: Width, pixels.
        height: Height, pixels.
    """
    return bytearray(_FORMAT.pack(CAPTURE, width, height, MJPEG, _FIELD_NONE))


def image_size(data: bytes | bytearray) -> tuple[int, int, int]:
    """Return width, height and pixel format as accepted by the camera."""
    _, width, height, kind, _ = _FORMAT.unpack(data)
    return width, height, kind


def frame_rate(fps: float) -> bytearray:
    """Return a request for a number of frames a second."""
    return bytearray(_PARAMETERS.pack(CAPTURE, 1000, round(fps * 1000)))


def request(buffers: int) -> bytearray:
    """Return a request for a number of buffers."""
    return bytearray(_REQUEST.pack(buffers, CAPTURE, _MEMORY_MMAP))


_BUFFERS: Final = 3
_SILENT_S: Final = 5.0  # Time after which a silent camera counts as hung.

Ioctl = Callable[[int, int, Any], int]


class V4l2:
    """Webcam; see `Camera`. Of several ready frames the newest is returned.

    Args:
        plan: The camera; its setting is the `device`, such as /dev/video0.
        ioctl: Calls the kernel.
    """

    def __init__(self, plan: CameraPlan, ioctl: Ioctl = fcntl.ioctl) -> None:
        if struct.calcsize("P") != 8:
            raise RobotError("The v4l2 camera needs a 64-bit system; take `pipe` with ffmpeg.")
        self._plan = plan
        self._ioctl = ioctl
        self._device: str = plan.settings["device"]
        self._interruption = Interruption()
        self._buffers: list[mmap.mmap] = []
        self._fd = -1
        try:
            self._fd = os.open(self._device, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
            self._start()
        except OSError as error:
            raise RobotError(f"The camera {self._device} does not answer: {error}.") from error

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`."""
        if not self._interruption.wait(self._fd, _SILENT_S):
            raise RobotError(f"The camera {self._device} has sent no frame for {_SILENT_S:g} s.")
        try:
            jpeg, captured_ns = self._newest()
        except OSError as error:
            raise RobotError(f"The camera {self._device} does not answer: {error}.") from error
        return checked_frame(jpeg, captured_ns, self._plan)

    def close(self) -> None:
        """Interrupt a waiting `read`."""
        self._interruption.set()

    def __del__(self) -> None:
        # Not in `close`: a `read` in another thread may still use a buffer.
        for buffer in self._buffers:
            buffer.close()
        if self._fd >= 0:
            os.close(self._fd)  # This stops the camera.

    def _start(self) -> None:
        wanted = pixel_format(*self._plan.size)
        self._ioctl(self._fd, SET_FORMAT, wanted)
        width, height, kind = image_size(wanted)
        if (width, height, kind) != (*self._plan.size, MJPEG):
            raise RobotError(
                f"The camera {self._device} offers no JPEG frames of {self._plan.size[0]} by "
                f"{self._plan.size[1]} pixels; `v4l2-ctl --list-formats-ext` lists what it offers."
            )
        self._ioctl(self._fd, SET_PARAMETERS, frame_rate(self._plan.fps))
        self._ioctl(self._fd, REQUEST_BUFFERS, request(_BUFFERS))
        for index in range(_BUFFERS):
            data = Buffer(index).pack()
            self._ioctl(self._fd, QUERY_BUFFER, data)
            buffer = Buffer.unpack(data)
            self._buffers.append(
                mmap.mmap(
                    self._fd,
                    buffer.length,
                    flags=mmap.MAP_SHARED,
                    prot=mmap.PROT_READ | mmap.PROT_WRITE,
                    offset=buffer.offset,
                )
            )
            self._ioctl(self._fd, QUEUE, data)
        self._ioctl(self._fd, STREAM_ON, struct.pack("=i", CAPTURE))

    def _newest(self) -> tuple[bytes, int]:
        newest: tuple[bytes, int] | None = None
        while True:
            data = Buffer(0).pack()
            try:
                self._ioctl(self._fd, DEQUEUE, data)
            except BlockingIOError:
                if newest is None:
                    raise
                return newest
            buffer = Buffer.unpack(data)
            if not buffer.flags & BUFFER_FLAG_ERROR:
                monotonic = buffer.flags & BUFFER_FLAG_TIMESTAMP_MASK == BUFFER_FLAG_MONOTONIC
                jpeg = self._buffers[buffer.index][: buffer.used]
                newest = jpeg, buffer.at_ns if monotonic else time.monotonic_ns()
            self._ioctl(self._fd, QUEUE, data)
