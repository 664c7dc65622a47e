"""Camera driver for a JPEG webcam over Video4Linux2.

Tested against a fake of the kernel's calls only, not on a camera. Structures and numbers are from
linux/videodev2.h on a 64-bit system.
"""

from __future__ import annotations

import ctypes
import fcntl
import mmap
import os
import time
from collections.abc import Callable
from typing import Any, Final

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.cameras.camera import Camera, CameraPlan, Frame
from shapechanger.robot.cameras.jpeg import checked_frame

SET_FORMAT: Final = 0xC0D05605  # VIDIOC_S_FMT
SET_PARAMETERS: Final = 0xC0CC5616  # VIDIOC_S_PARM
REQUEST_BUFFERS: Final = 0xC0145608  # VIDIOC_REQBUFS
QUERY_BUFFER: Final = 0xC0585609  # VIDIOC_QUERYBUF
QUEUE: Final = 0xC058560F  # VIDIOC_QBUF
DEQUEUE: Final = 0xC0585611  # VIDIOC_DQBUF
STREAM_ON: Final = 0x40045612  # VIDIOC_STREAMON

MJPEG: Final = 0x47504A4D  # V4L2_PIX_FMT_MJPEG
BUFFER_FLAG_ERROR: Final = 0x40
BUFFER_FLAG_TIMESTAMP_MASK: Final = 0xE000
BUFFER_FLAG_MONOTONIC: Final = 0x2000

_CAPTURE: Final = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
_MEMORY_MMAP: Final = 1
_FIELD_NONE: Final = 1
_U32: Final = ctypes.c_uint32
_BUFFERS: Final = 3
_SILENT_S: Final = 5.0  # Time after which a silent camera counts as hung.


def _words(*names: str) -> tuple[tuple[str, type[ctypes.c_uint32]], ...]:
    return tuple((name, _U32) for name in names)


class Buffer(ctypes.Structure):
    """Struct v4l2_buffer: a buffer of the kernel and its frame."""

    _fields_ = (
        *_words("index", "type", "used", "flags", "field"),
        ("seconds", ctypes.c_int64),
        ("microseconds", ctypes.c_int64),
        ("timecode", _U32 * 4),
        *_words("sequence", "memory"),
        ("offset", ctypes.c_uint64),
        *_words("length", "reserved", "request"),
    )


class PixelFormat(ctypes.Structure):
    """Struct v4l2_format."""

    _fields_ = (*_words("type", "padding", "width", "height", "kind", "field"), ("rest", _U32 * 46))


class Parameters(ctypes.Structure):
    """Struct v4l2_streamparm, with the time of a frame as a fraction of a second."""

    _fields_ = (*_words("type", "capability", "mode", "numerator", "denominator"), ("r", _U32 * 46))


class BufferRequest(ctypes.Structure):
    """Struct v4l2_requestbuffers."""

    _fields_ = _words("count", "type", "memory", "caps", "rest")


class V4l2(Camera):
    """Webcam; see `Camera`. If several frames are ready, the newest is returned.

    `ioctl` is a function that calls the kernel, like `fcntl.ioctl`.
    """

    def __init__(
        self, plan: CameraPlan, ioctl: Callable[[int, int, Any], int] = fcntl.ioctl
    ) -> None:
        super().__init__(plan)
        if ctypes.sizeof(ctypes.c_void_p) != 8:
            raise RobotError("The v4l2 camera needs a 64-bit system: use a pipe from ffmpeg.")
        self._ioctl = ioctl
        self._device: str = plan.settings["device"]
        self._buffers: list[mmap.mmap] = []
        self._fd = -1
        with translate_errors(OSError, to=self._dead):
            self._fd = os.open(self._device, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
            self._start()

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`."""
        if not self.wait(self._fd, _SILENT_S):
            raise RobotError(f"The camera {self._device} has sent no frame for {_SILENT_S:g} s.")
        with translate_errors(OSError, to=self._dead):
            jpeg, captured_ns = self._newest()
        return checked_frame(jpeg, captured_ns, self.plan)

    def _dead(self, error: OSError) -> RobotError:
        return RobotError(f"The camera {self._device} does not answer: {error}.")

    def __del__(self) -> None:
        # Not done in `close`: a `read` in another thread may still use a buffer.
        super().__del__()
        for buffer in self._buffers:
            buffer.close()
        if self._fd >= 0:
            os.close(self._fd)  # This stops the camera.

    def _start(self) -> None:
        width, height = self.plan.size
        wanted = PixelFormat(_CAPTURE, 0, width, height, MJPEG, _FIELD_NONE)
        self._ioctl(self._fd, SET_FORMAT, wanted)
        if (wanted.width, wanted.height, wanted.kind) != (width, height, MJPEG):
            raise RobotError(
                f"The camera {self._device} offers no JPEG frames of {width} by {height} pixels; "
                "`v4l2-ctl --list-formats-ext` lists what it offers."
            )
        rate = Parameters(type=_CAPTURE, numerator=1000, denominator=round(1000 * self.plan.fps))
        self._ioctl(self._fd, SET_PARAMETERS, rate)
        asked = BufferRequest(count=_BUFFERS, type=_CAPTURE, memory=_MEMORY_MMAP)
        self._ioctl(self._fd, REQUEST_BUFFERS, asked)
        for index in range(_BUFFERS):
            buffer = Buffer(index=index, type=_CAPTURE, memory=_MEMORY_MMAP)
            self._ioctl(self._fd, QUERY_BUFFER, buffer)
            offset = buffer.offset & 0xFFFFFFFF  # The kernel sets only 32 bits of this union.
            self._buffers.append(mmap.mmap(self._fd, buffer.length, offset=offset))
            self._ioctl(self._fd, QUEUE, buffer)
        self._ioctl(self._fd, STREAM_ON, ctypes.c_int(_CAPTURE))

    def _newest(self) -> tuple[bytes, int]:
        newest: tuple[bytes, int] | None = None
        while True:
            buffer: Any = Buffer(type=_CAPTURE, memory=_MEMORY_MMAP)
            try:
                self._ioctl(self._fd, DEQUEUE, buffer)
            except BlockingIOError:
                if newest is None:
                    raise
                return newest
            if not buffer.flags & BUFFER_FLAG_ERROR:
                at_ns = time.monotonic_ns()
                if buffer.flags & BUFFER_FLAG_TIMESTAMP_MASK == BUFFER_FLAG_MONOTONIC:
                    at_ns = buffer.seconds * 1_000_000_000 + buffer.microseconds * 1000
                index: int = buffer.index
                newest = self._buffers[index][: buffer.used], at_ns
            self._ioctl(self._fd, QUEUE, buffer)
