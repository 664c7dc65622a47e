"""Cameras without a driver: a stream, a folder of images, and a test pattern."""

from __future__ import annotations

import binascii
import os
import shlex
import stat
import subprocess
import time
from contextlib import suppress
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.cameras.camera import Camera, CameraPlan, Frame
from shapechanger.robot.cameras.jpeg import (
    JpegSplitter,
    captured_ns_of,
    checked_frame,
    encoded_frame,
)

_CHUNK: Final = 64 * 1024  # Bytes; the default capacity of a Linux pipe.
_MOST_WAITING: Final = 1 << 20  # Bytes; the largest capacity of a pipe without privileges.
_PROGRAM_ENDS_S: Final = 2.0  # Time for a program to exit after SIGTERM, s; then SIGKILL.
_SUFFIXES: Final = (".jpg", ".jpeg")


class Pipe(Camera):
    """JPEG stream from a named pipe, a file or a program such as rpicam-vid; see `Camera`.

    A frame may have its time of capture in a comment segment (`captured_ns=`, monotonic). Otherwise
    its time is when it is read, which does not include the delay of the source. A frame without a
    time that waited in a pipe would look new, so the waiting frames, up to 1 MiB, are read, and the
    newest one is returned. A file is read frame by frame.

    Its setting is `path`: a pipe, a file, or a program with arguments after `|`.
    """

    def __init__(self, plan: CameraPlan) -> None:
        super().__init__(plan)
        self._fd = -1
        self._path: str = plan.settings["path"]
        self._program: subprocess.Popen[bytes] | None = None
        self._splitter = JpegSplitter()
        with translate_errors(
            OSError, to=lambda error: RobotError(f"The stream cannot be opened: {error}.")
        ):
            self._open()
        self._live = not stat.S_ISREG(os.fstat(self._fd).st_mode)

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`. Bytes between frames are skipped."""
        skipped = self._splitter.skipped
        while (jpeg := self._splitter.next()) is None:
            self._await_data()
        left = _MOST_WAITING
        while self._live:
            while (newer := self._splitter.next()) is not None:
                jpeg = newer
            if captured_ns_of(jpeg) is not None or left <= 0 or not (waiting := self._waiting()):
                break
            self._splitter.feed(waiting)
            left -= len(waiting)
        captured_ns = captured_ns_of(jpeg)
        at_ns = time.monotonic_ns() if captured_ns is None else captured_ns
        frame = checked_frame(jpeg, at_ns, self.plan)
        return replace(frame, skipped=self._splitter.skipped - skipped)

    def close(self) -> None:
        """Interrupt a waiting `read`, and end the program."""
        super().close()
        if self._program is not None and self._program.poll() is None:
            self._program.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._program.wait(_PROGRAM_ENDS_S)
            self._program.kill()
            self._program.wait()

    def __del__(self) -> None:
        # Not in `close`: a `read` in another thread may still be waiting on the stream.
        super().__del__()
        if self._fd >= 0:
            os.close(self._fd)

    def _open(self) -> None:
        if not self._path.startswith("|"):
            # Opening a named pipe would otherwise block until it has a writer.
            flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
            self._fd = os.open(os.path.expanduser(self._path), flags)
            return
        self._fd, its_end = os.pipe()
        os.set_blocking(self._fd, False)
        with os.fdopen(its_end, "wb") as output:
            arguments = shlex.split(self._path[1:])
            self._program = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=output)

    def _waiting(self) -> bytes | None:
        """Return the available data of the stream, b"" at its end; None if there is no data yet."""
        with suppress(BlockingIOError):
            return os.read(self._fd, _CHUNK)
        return None

    def _await_data(self) -> None:
        if self._fd < 0:
            self._open()
        self.wait(self._fd)
        data = self._waiting()
        if data is None:
            return  # Another reader of the pipe took the data.
        if not data:
            # The next read reopens the pipe and waits for its next writer.
            self._splitter = JpegSplitter()
            if self._program is None and self._live:
                os.close(self._fd)
                self._fd = -1
            raise RobotError(f"The stream of {self._path} has ended.")
        self._splitter.feed(data)


class Folder(Camera):
    """Camera that replays the JPEG files of the folder `path`, sorted by name, in a loop."""

    def __init__(self, plan: CameraPlan) -> None:
        super().__init__(plan)
        folder = Path(plan.settings["path"]).expanduser()
        with translate_errors(
            OSError,
            to=lambda error: RobotError(f"The folder of images cannot be read: {error}."),
        ):
            files = sorted(one for one in folder.iterdir() if one.suffix.lower() in _SUFFIXES)
        if not files:
            raise RobotError(f"There is no .jpg or .jpeg file in {folder}.")
        self._files = cycle(files)

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`. A bad file is skipped after its error."""
        captured_ns = self.pace()
        file = next(self._files)
        with translate_errors(OSError, RobotError, to=lambda error: RobotError(f"{file}: {error}")):
            return checked_frame(file.read_bytes(), captured_ns, self.plan)


_BARCODE_BYTES: Final = 6
"""Bytes of the number. In nanoseconds, it overflows after 78 hours."""

_COLUMNS: Final = 32
_ROWS: Final = 2
_LEAST_WIDTH: Final = 96  # Pixels: 3 by 4 is the smallest cell that survives JPEG.
_LEAST_CELL_HEIGHT: Final = 4  # Pixels: two rows fill one row of 8-pixel JPEG blocks.

# The check starts at a value other than 0, so that black or white images are not barcodes.
_CHECK_START: Final = 0xFFFF


def barcode_rows(width: int) -> int:
    """Return the height of a barcode in an image of this width, pixels."""
    return _ROWS * max(_LEAST_CELL_HEIGHT, width // 40)


def draw_barcode(image: NDArray[np.uint8], number: int) -> None:
    """Draw the lowest 48 bits of a number over the first rows of an image, in place.

    The image has the shape (height, width, 3) and is at least 96 pixels wide.
    """
    height, width = image.shape[:2]
    rows = barcode_rows(width)
    if width < _LEAST_WIDTH or height < rows:
        raise RobotError(
            f"An image of {width} by {height} pixels is too small for its barcode, which needs at "
            f"least {_LEAST_WIDTH} by {rows}."
        )
    data = (number % 256**_BARCODE_BYTES).to_bytes(_BARCODE_BYTES)
    data += binascii.crc_hqx(data, _CHECK_START).to_bytes(2)
    cells = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(_ROWS, _COLUMNS) * np.uint8(255)
    cell_height, cell_width = rows // _ROWS, width // _COLUMNS
    drawn = cells.repeat(cell_height, axis=0).repeat(cell_width, axis=1)
    image[:rows, : drawn.shape[1]] = drawn[..., np.newaxis]


class Pattern(Camera):
    """Camera with drifting colours and the time of capture as a barcode; it ignores `flip`."""

    def __init__(self, plan: CameraPlan) -> None:
        super().__init__(plan)
        self._draw(0)  # Refuse a size that is too small.

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`."""
        captured_ns = self.pace()
        return encoded_frame(self._draw(captured_ns), captured_ns, self.plan)

    def _draw(self, captured_ns: int) -> NDArray[np.uint8]:
        width, height = self.plan.size
        across = np.arange(width) + captured_ns // 20_000_000  # 50 pixels per second.
        down = np.arange(height)[:, np.newaxis]
        image = np.empty((height, width, 3), np.uint8)
        image[..., 0] = across * 2 % 256
        image[..., 1] = down * 2 % 256
        image[..., 2] = (across + down) % 256
        draw_barcode(image, captured_ns)
        return image
