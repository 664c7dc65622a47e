"""A webcam with JPEG pictures, over the kernel's Video4Linux2 and nothing else.

It was run against a fake of the kernel's calls only, and never on a camera.
"""

from __future__ import annotations

import fcntl
import mmap
import os
import struct
import time
from collections.abc import Callable
from typing import Any, Final

from shapechanger.errors import RobotError
from shapechanger.robot.cameras import v4l2_api as api
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.cameras.checked import check_jpeg
from shapechanger.robot.cameras.interruption import Interruption
from shapechanger.robot.cameras.turned import turned

__all__ = ["V4l2", "open_driver"]

_BUFFERS: Final = 3
_SILENT_S: Final = 5.0  # A camera that gives nothing for so long hangs.

Ioctl = Callable[[int, int, Any], int]


class V4l2:
    """A webcam; see `Camera`. Of several pictures that are ready, the newest is given."""

    def __init__(self, plan: CameraPlan, ioctl: Ioctl = fcntl.ioctl) -> None:
        if struct.calcsize("P") != 8:
            raise RobotError("The v4l2 camera needs a 64-bit system; take `pipe` with ffmpeg.")
        self._plan = plan
        self._ioctl = ioctl
        self._device = str(plan.settings["device"])
        self._interruption = Interruption()
        self._buffers: list[mmap.mmap] = []
        self._fd = -1
        try:
            self._fd = os.open(self._device, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
            self._start()
        except OSError as error:
            raise RobotError(f"The camera {self._device} does not answer: {error}.") from error

    def read(self) -> Frame:
        """Wait for the next picture; see `Camera.read`."""
        if not self._interruption.wait(self._fd, _SILENT_S):
            raise RobotError(f"The camera {self._device} has given nothing for {_SILENT_S:g} s.")
        try:
            jpeg, captured_ns = self._newest()
        except OSError as error:
            raise RobotError(f"The camera {self._device} does not answer: {error}.") from error
        check_jpeg(jpeg, self._plan.size)
        if self._plan.flip:
            jpeg = turned(jpeg, self._plan.jpeg_quality)
        return Frame(jpeg, captured_ns)

    def close(self) -> None:
        """End a `read` that waits."""
        self._interruption.set()

    def __del__(self) -> None:
        # Not in `close`: a `read` in another thread may still look at a buffer.
        for buffer in self._buffers:
            buffer.close()
        if self._fd >= 0:
            os.close(self._fd)  # The kernel stops the camera then.

    def _start(self) -> None:
        wanted = api.pixel_format(*self._plan.size)
        self._ioctl(self._fd, api.SET_FORMAT, wanted)
        width, height, kind = api.image_size(wanted)
        if (width, height, kind) != (*self._plan.size, api.MJPEG):
            raise RobotError(
                f"The camera {self._device} has no JPEG pictures of {self._plan.size[0]} by "
                f"{self._plan.size[1]} pixels; `v4l2-ctl --list-formats-ext` lists what it has."
            )
        self._ioctl(self._fd, api.SET_PARAMETERS, api.frame_rate(self._plan.fps))
        self._ioctl(self._fd, api.REQUEST_BUFFERS, api.request(_BUFFERS))
        for index in range(_BUFFERS):
            data = api.Buffer(index).pack()
            self._ioctl(self._fd, api.QUERY_BUFFER, data)
            buffer = api.Buffer.unpack(data)
            self._buffers.append(
                mmap.mmap(
                    self._fd,
                    buffer.length,
                    flags=mmap.MAP_SHARED,
                    prot=mmap.PROT_READ | mmap.PROT_WRITE,
                    offset=buffer.offset,
                )
            )
            self._ioctl(self._fd, api.QUEUE, data)
        self._ioctl(self._fd, api.STREAM_ON, struct.pack("=i", api.CAPTURE))

    def _newest(self) -> tuple[bytes, int]:
        newest: tuple[bytes, int] | None = None
        while True:
            data = api.Buffer(0).pack()
            try:
                self._ioctl(self._fd, api.DEQUEUE, data)
            except BlockingIOError:
                if newest is None:
                    raise
                return newest
            buffer = api.Buffer.unpack(data)
            if not buffer.flags & api.BUFFER_FLAG_ERROR:
                monotonic = (
                    buffer.flags & api.BUFFER_FLAG_TIMESTAMP_MASK == api.BUFFER_FLAG_MONOTONIC
                )
                # Cameras fill up with zeros after the end of a picture.
                jpeg = self._buffers[buffer.index][: buffer.used].rstrip(b"\0")
                newest = jpeg, buffer.at_ns if monotonic else time.monotonic_ns()
            self._ioctl(self._fd, api.QUEUE, data)


def open_driver(plan: CameraPlan) -> V4l2:
    """Open the webcam at `device`, such as /dev/video0."""
    return V4l2(plan)
