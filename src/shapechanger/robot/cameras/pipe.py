"""Camera driver for a JPEG stream from a named pipe, a file or a program such as rpicam-vid.

A frame may carry its time of capture in a comment segment (`captured_ns=`, monotonic). Otherwise
it gets the time of its last byte, which hides the delay of the source; so that frames that waited
in the pipe do not look new, the pipe is drained first.
"""

from __future__ import annotations

import os
import shlex
import stat
import subprocess
import time
from dataclasses import replace
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame, Interruption
from shapechanger.robot.cameras.jpeg import JpegSplitter, captured_ns_of, checked_frame

_CHUNK: Final = 64 * 1024  # Bytes; the default capacity of a Linux pipe.
_MOST_WAITING: Final = 1 << 20  # Bytes; the largest capacity of a pipe without privileges.
_PROGRAM_ENDS_S: Final = 2.0


class Pipe:
    """Camera at the other end of a pipe; see `Camera`.

    Of several buffered frames the newest is returned, except from a file.

    Its setting is `path`: a pipe, a file, or a program with arguments after `|`.
    """

    def __init__(self, plan: CameraPlan) -> None:
        self._plan = plan
        self._path: str = plan.settings["path"]
        self._program: subprocess.Popen[bytes] | None = None
        self._splitter = JpegSplitter()
        self._interruption = Interruption()
        self._fd: int | None = None
        try:
            self._fd = self._open()
        except OSError as error:
            raise RobotError(f"The stream cannot be opened: {error}.") from error
        self._live = not stat.S_ISREG(os.fstat(self._fd).st_mode)

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`. Bytes between frames are skipped."""
        skipped = self._splitter.skipped
        jpeg: bytes | None = self._splitter.next()
        while jpeg is None:
            self._feed()
            jpeg = self._splitter.next()
        jpeg = self._newest(jpeg)
        captured_ns = captured_ns_of(jpeg)
        left = _MOST_WAITING
        while captured_ns is None and left > 0 and (count := self._take_waiting()):
            left -= count
            jpeg = self._newest(jpeg)
            captured_ns = captured_ns_of(jpeg)
        arrived_ns = time.monotonic_ns()
        at_ns = arrived_ns if captured_ns is None else captured_ns
        frame = checked_frame(jpeg, at_ns, self._plan)
        return replace(frame, skipped=self._splitter.skipped - skipped)

    def close(self) -> None:
        """Interrupt a waiting `read`, and end the program."""
        self._interruption.set()
        if self._program is not None and self._program.poll() is None:
            self._program.terminate()
            try:
                self._program.wait(_PROGRAM_ENDS_S)
            except subprocess.TimeoutExpired:
                self._program.kill()
                self._program.wait()

    def __del__(self) -> None:
        # Not in `close`: a `read` in another thread may still be waiting on it.
        if self._fd is not None:
            os.close(self._fd)

    def _open(self) -> int:
        if self._path.startswith("|"):
            fd, its_end = os.pipe()
            try:
                self._program = subprocess.Popen(
                    shlex.split(self._path[1:]), stdin=subprocess.DEVNULL, stdout=its_end
                )
            except OSError:
                os.close(fd)
                raise
            finally:
                os.close(its_end)
            os.set_blocking(fd, False)
            return fd
        # Opening a named pipe would otherwise block until it has a writer.
        return os.open(os.path.expanduser(self._path), os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)

    def _newest(self, jpeg: bytes) -> bytes:
        while self._live and (newer := self._splitter.next()) is not None:
            jpeg = newer
        return jpeg

    def _take_waiting(self) -> int:
        """Read what waits in the pipe and return its size in bytes; 0 also at the end."""
        if not self._live or self._fd is None:
            return 0
        try:
            data = os.read(self._fd, _CHUNK)
        except BlockingIOError:
            return 0
        self._splitter.feed(data)
        return len(data)

    def _feed(self) -> None:
        if self._fd is None:
            self._fd = self._open()
        self._interruption.wait(self._fd)
        try:
            data = os.read(self._fd, _CHUNK)
        except BlockingIOError:
            return  # Another reader took it; a named pipe may have several.
        if not data:
            self._start_again()
            raise RobotError(f"The stream of {self._path} has ended.")
        self._splitter.feed(data)

    def _start_again(self) -> None:
        # The next read reopens the pipe and waits for its next writer.
        self._splitter = JpegSplitter()
        if self._program is None and self._live and self._fd is not None:
            os.close(self._fd)
            self._fd = None
