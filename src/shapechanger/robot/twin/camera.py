"""Front camera: writes images of the world as JPEG into a pipe."""

from __future__ import annotations

import errno
import fcntl
import os
import random
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Final, Literal, get_args

import numpy as np
import simplejpeg

from shapechanger.contract.world import World
from shapechanger.errors import UnknownName
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.cameras.jpeg import with_capture_time
from shapechanger.robot.cameras.sources import draw_barcode

CameraFault = Literal["", "off", "freeze", "garbage", "short"]
"""Faults of a camera: no images, repeats of one image, noise, or half images; "" for none."""

_PIPE_BYTES: Final = 1 << 20  # The largest size of a pipe that Linux allows without privileges.
_FIONREAD: Final = 0x541B


@dataclass
class FrontCameraPipe:
    """Takes images and writes them into a FIFO, without ever waiting for its reader."""

    path: Path  # Path of the FIFO.
    plan: CameraPlan
    world: World
    start_ns: int  # Time of the first image.
    _: KW_ONLY
    # Whether to drop an image while the previous image is unread. If False, images are dropped only
    # if the pipe is full or has no reader.
    latest_only: bool
    barcode: bool = True  # Whether the first rows of an image show its capture time.

    def __post_init__(self) -> None:
        self.next_ns = self.start_ns  # Time of the next image.
        self.newest_ns: int | None = None  # Capture time of the newest image that was written.
        self._taken = 0
        self._fd: int | None = None
        self._rest = b""  # Rest of an image that did not fit into the pipe.
        self._rest_ns: int | None = None
        self._last, self._last_ns = b"", 0
        self._noise = random.Random("camera")
        self._fault = ""

    def take(self, now_ns: int) -> None:
        """Take and write the image that is due, if the pipe accepts it; skip earlier images."""
        while self.next_ns <= now_ns:
            self._taken += 1
            self.next_ns = self.start_ns + round(self._taken * 1e9 / self.plan.fps)
        if self._fault == "off" or not self._ready():
            return
        if self._fault != "freeze" or not self._last:
            self._last, self._last_ns = self.draw(now_ns), now_ns
        match self._fault:
            case "garbage":
                self._write(self._noise.randbytes(len(self._last)), None)
            case "short":
                self._write(self._last[: len(self._last) // 2], None)
            case _:
                self._write(self._last, self._last_ns)

    def break_down(self, fault: CameraFault | str) -> None:
        """Cause a fault of the camera; "" repairs it."""
        if fault not in (faults := get_args(CameraFault)):
            raise UnknownName("fault of a camera", fault, faults)
        self._fault = fault

    def draw(self, now_ns: int) -> bytes:
        """Return the current image as JPEG, with its time in a comment and, if set, a barcode."""
        picture = np.ascontiguousarray(self.world.picture())
        if self.barcode:
            draw_barcode(picture, now_ns)
        jpeg = simplejpeg.encode_jpeg(picture, self.plan.jpeg_quality, "RGB", "444")
        return with_capture_time(jpeg, now_ns)

    def close(self) -> None:
        """Close the pipe."""
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None
            self._rest = b""

    def find_reader(self) -> bool:
        """Open the pipe if it has a reader; return whether it is open."""
        if self._fd is None:
            try:
                self._fd = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK)
            except OSError as error:
                if error.errno == errno.ENXIO:  # No reader.
                    return False
                raise
            fcntl.fcntl(self._fd, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
        return True

    def _ready(self) -> bool:
        """Write the rest of the last image; return whether a new image can be written now."""
        if not self.find_reader():
            return False
        if self._rest:
            self._write(self._rest, self._rest_ns)
        if self._rest or self._fd is None or not self.latest_only:
            return not self._rest
        return not any(fcntl.ioctl(self._fd, _FIONREAD, bytes(4)))  # Bytes that wait in the pipe.

    def _write(self, data: bytes, captured_ns: int | None) -> None:
        """Write as much as the pipe accepts, and keep the rest for the next `_ready`."""
        if self._fd is None:
            return
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            return  # The pipe is full: a new image is dropped, and the rest of an image is kept.
        except BrokenPipeError:
            self.close()
            return
        self._rest, self._rest_ns = data[written:], captured_ns
        if not self._rest and captured_ns is not None:
            self.newest_ns = captured_ns
