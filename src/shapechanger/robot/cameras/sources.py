"""Cameras without a driver: a stream, a folder of images, and a test pattern."""

from __future__ import annotations

import binascii
import os
import shlex
import stat
import subprocess
import time
from contextlib import ExitStack, suppress
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.cameras.camera import CameraPlan, Frame, WaitingCamera
from shapechanger.robot.cameras.jpeg import JpegSplitter, captured_ns_of, checked_frame

_CHUNK: Final = 64 * 1024  # Bytes; the default capacity of a Linux pipe.
_MOST_WAITING: Final = 1 << 20  # Bytes; the largest capacity of a pipe without privileges.
_PROGRAM_ENDS_S: Final = 2.0
_SUFFIXES: Final = (".jpg", ".jpeg")


class Pipe(WaitingCamera):
    """JPEG stream from a named pipe, a file or a program such as rpicam-vid; see `Camera`.

    A frame may carry its time of capture in a comment segment (`captured_ns=`, monotonic).
    Otherwise it gets the time of its last byte, which hides the delay of the source; so that frames
    that waited in the pipe do not look new, the pipe is drained first, and of several frames the
    newest is returned, except from a file.

    Its setting is `path`: a pipe, a file, or a program with arguments after `|`.
    """

    def __init__(self, plan: CameraPlan) -> None:
        super().__init__(plan)
        self._fd: int | None = None
        self._path: str = plan.settings["path"]
        self._program: subprocess.Popen[bytes] | None = None
        self._splitter = JpegSplitter()
        with translate_errors(
            OSError, to=lambda error: RobotError(f"The stream cannot be opened: {error}.")
        ):
            self._fd = self._open()
        self._live = not stat.S_ISREG(os.fstat(self._fd).st_mode)

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`. Bytes between frames are skipped."""
        skipped = self._splitter.skipped
        while (jpeg := self._splitter.next()) is None:
            self._await_data()
        left = _MOST_WAITING
        captured_ns = None
        while True:
            while self._live and (newer := self._splitter.next()) is not None:
                jpeg = newer
            captured_ns = captured_ns_of(jpeg)
            if captured_ns is not None or left <= 0 or not (waiting := self._waiting()):
                break
            self._splitter.feed(waiting)
            left -= len(waiting)
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
        # Not in `close`: a `read` in another thread may still be waiting on it.
        super().__del__()
        if self._fd is not None:
            os.close(self._fd)

    def _open(self) -> int:
        if not self._path.startswith("|"):
            # Opening a named pipe would otherwise block until it has a writer.
            flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
            return os.open(os.path.expanduser(self._path), flags)
        words = shlex.split(self._path[1:])
        with ExitStack() as undo:
            fd, its_end = os.pipe()
            undo.callback(os.close, fd)
            with os.fdopen(its_end, "wb") as output:
                self._program = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=output)
            undo.pop_all()
        os.set_blocking(fd, False)
        return fd

    def _waiting(self) -> bytes | None:
        """Return data that waits in the pipe, b"" at its end; None without data."""
        if self._fd is None or not self._live:
            return None
        with suppress(BlockingIOError):
            return os.read(self._fd, _CHUNK)
        return None

    def _await_data(self) -> None:
        if self._fd is None:
            self._fd = self._open()
        self.wait(self._fd)
        data = self._waiting() if self._live else os.read(self._fd, _CHUNK)
        if data is None:
            return  # Another reader took it; a named pipe may have several.
        if not data:
            # The next read reopens the pipe and waits for its next writer.
            self._splitter = JpegSplitter()
            if self._program is None and self._live:
                os.close(self._fd)
                self._fd = None
            raise RobotError(f"The stream of {self._path} has ended.")
        self._splitter.feed(data)


class Folder(WaitingCamera):
    """Camera that replays the files of a folder in the order of their names; see `Camera`.

    Its setting is the folder, `path`.
    """

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
        """Wait for the next frame; see `Camera.read`. A bad file is reported once, then skipped."""
        captured_ns = self.pace()
        file = next(self._files)
        with translate_errors(OSError, RobotError, to=lambda error: RobotError(f"{file}: {error}")):
            return checked_frame(file.read_bytes(), captured_ns, self.plan)


_BARCODE_BITS: Final = 48
"""Bits of the number. In nanoseconds they count 78 hours, and then start again."""

_BYTES: Final = _BARCODE_BITS // 8
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
    """Draw the lowest 48 bits of a number over the first rows of an image.

    Args:
        image: The image, shape (height, width, 3), at least 96 pixels wide; changed in place.
        number: At least 0.
    """
    height, width = image.shape[:2]
    rows = barcode_rows(width)
    if width < _LEAST_WIDTH or height < rows or number < 0:
        raise ValueError(
            f"A barcode needs a number of at least 0, not {number}, and an image of at least "
            f"{_LEAST_WIDTH} by {rows} pixels, not {width} by {height}."
        )
    data = (number % 2**_BARCODE_BITS).to_bytes(_BYTES, "big")
    data += binascii.crc_hqx(data, _CHECK_START).to_bytes(2, "big")
    cells = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(_ROWS, _COLUMNS) * np.uint8(255)
    cell_height, cell_width = rows // _ROWS, width // _COLUMNS
    drawn = cells.repeat(cell_height, axis=0).repeat(cell_width, axis=1)
    image[:rows, : drawn.shape[1]] = drawn[..., np.newaxis]


class Pattern(WaitingCamera):
    """Camera with drifting colours and the time of capture as a barcode; see `Camera`.

    It has no settings and ignores `flip`.
    """

    def __init__(self, plan: CameraPlan) -> None:
        super().__init__(plan)
        width, height = plan.size
        if width < _LEAST_WIDTH or height < barcode_rows(width):
            raise RobotError(
                f"A test pattern of {width} by {height} pixels is too small for its "
                f"barcode, which needs a width of at least {_LEAST_WIDTH}."
            )

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`."""
        captured_ns = self.pace()
        width, height = self.plan.size
        across = np.arange(width) + captured_ns // 20_000_000  # 50 pixels per second.
        down = np.arange(height)[:, np.newaxis]
        image = np.empty((height, width, 3), np.uint8)
        image[..., 0] = across * 2 % 256
        image[..., 1] = down * 2 % 256
        image[..., 2] = (across + down) % 256
        draw_barcode(image, captured_ns)
        jpeg = simplejpeg.encode_jpeg(image, self.plan.jpeg_quality, colorsubsampling="420")
        return Frame(jpeg, captured_ns, encoded_here=True)
