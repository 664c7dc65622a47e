"""MP4 videos, written and read by an FFmpeg process.

The program comes with imageio-ffmpeg. Files of strangers are decoded in its process and not in this
one: as MP4 only, without references to other files, and with a limit of pixels.
"""

from __future__ import annotations

import contextlib
import subprocess
import tempfile
from collections.abc import Generator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import library
from shapechanger.demos.jpeg import MAX_PIXELS
from shapechanger.errors import DemosError, OutputError

# Constant quality, 0 to 51; see the measured error in docs/exchange.md.
_QUALITY: Final = 18
_KEY_FRAMES: Final = 2  # Each second picture stands alone, so that learners can read any quickly.
_LONGEST_LINE: Final = 64


def _ffmpeg(arguments: Sequence[str]) -> list[str]:
    """Return the command line of FFmpeg."""
    try:
        path = cast("str", library("imageio_ffmpeg", "lerobot").get_ffmpeg_exe())
    except RuntimeError as error:  # Where its wheel brings none.
        raise DemosError(f"Videos need FFmpeg: {error}") from error
    return [path, "-hide_banner", "-loglevel", "error", "-nostdin", *arguments]


class VideoWriter:
    """Writer of a video in H.264, with 4:2:0 colours and a constant rate.

    Args:
        path: The file to create.
        size: Width and height in pixels; both even.
        rate: Pictures per second.

    Attributes:
        frames: Number of pictures written.

    Raises:
        DemosError: If the width or the height is odd.
        MissingExtra: If there is no FFmpeg.
    """

    CODEC: Final = "h264"
    PIXELS: Final = "yuv420p"

    def __init__(self, path: Path, size: tuple[int, int], rate: Fraction) -> None:
        width, height = size
        if width % 2 or height % 2:
            raise DemosError(
                f"A video needs an even width and height, and the pictures have {width} x "
                f"{height} pixels: export them with --images."
            )
        self.frames = 0
        self._path = path
        self._rate = rate
        hz = f"{rate.numerator}/{rate.denominator}"
        raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", hz]
        coding = ["-c:v", "libx264", "-crf", str(_QUALITY), "-g", str(_KEY_FRAMES), "-bf", "0"]
        out = ["-pix_fmt", self.PIXELS, "-movflags", "+faststart", f"file:{path.absolute()}"]
        self._log = tempfile.TemporaryFile()  # Closed by `close`.  # noqa: SIM115
        self._process = subprocess.Popen(
            _ffmpeg([*raw, "-i", "pipe:0", *coding, *out]),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._log,
        )

    @property
    def seconds(self) -> float:
        """Duration of what is written, s."""
        return float(self.frames / self._rate)

    @property
    def bytes_written(self) -> int:
        """Size of the file so far, bytes."""
        return self._path.stat().st_size if self._path.exists() else 0

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Append a picture, shape (height, width, 3).

        Raises:
            OutputError: If it cannot be written.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.ascontiguousarray(pixels).data)
        except OSError as error:
            raise self._failure() from error
        self.frames += 1

    def close(self) -> None:
        """Finish the file.

        Raises:
            OutputError: If it cannot be written.
        """
        try:
            self._process.communicate()
            if self._process.returncode:
                raise self._failure()
        finally:
            self._log.close()

    def _failure(self) -> OutputError:
        self._process.wait()
        return OutputError(f"Cannot write {self._path}: {_last_line(self._log) or 'FFmpeg ended'}.")


def read_video(
    path: Path, start_s: float, count: int, rate_hz: float, size: tuple[int, int]
) -> Generator[NDArray[np.uint8]]:
    """Yield consecutive pictures of an MP4 video, shape (height, width, 3).

    Args:
        path: The file.
        start_s: Time of the first picture, s.
        count: Number of pictures.
        rate_hz: Pictures per second.
        size: Width and height that the pictures must have, pixels.

    Raises:
        DemosError: If the video is damaged, shorter, or of another size.
        MissingExtra: If there is no FFmpeg.
    """
    since_s = max(0.0, start_s - 0.5 / rate_hz)  # Rounding must not miss the first picture.
    reading = ["-protocol_whitelist", "file", "-max_pixels", str(MAX_PIXELS), "-f", "mov"]
    seek = ["-ss", f"{since_s:.6f}"] if since_s else []
    taken = ["-map", "0:v:0", "-frames:v", str(count), "-fps_mode", "passthrough"]
    out = ["-f", "image2pipe", "-c:v", "ppm", "-pix_fmt", "rgb24", "pipe:1"]
    command = _ffmpeg([*reading, *seek, "-i", f"file:{path.absolute()}", *taken, *out])
    width, height = size
    with (
        tempfile.TemporaryFile() as log,
        subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log
        ) as process,
    ):
        assert process.stdout is not None
        try:
            for number in range(count):
                # Each picture is a PPM: "P6", width and height, 255, and the pixels.
                head = [process.stdout.readline(_LONGEST_LINE) for _ in range(3)]
                if not head[0]:
                    process.wait()
                    why = f" ({problem})" if (problem := _last_line(log)) else ""
                    raise DemosError(
                        f"{path} ends after {number} of the {count} pictures of an episode{why}: "
                        "restore it."
                    )
                if head != [b"P6\n", f"{width} {height}\n".encode(), b"255\n"]:
                    found = head[1].decode(errors="replace").strip().replace(" ", " x ")
                    raise DemosError(
                        f"The pictures in {path} have {found} pixels, but meta/info.json says "
                        f"{width} x {height}."
                    )
                data = process.stdout.read(width * height * 3)
                if len(data) < width * height * 3:
                    raise DemosError(f"{path} is damaged at picture {number} of an episode.")
                yield np.frombuffer(data, np.uint8).reshape(height, width, 3)
        finally:
            with contextlib.suppress(OSError):
                process.kill()


def _last_line(log: object) -> str:
    """Return the last line of FFmpeg's log, without its end."""
    file = cast("tempfile.SpooledTemporaryFile[bytes]", log)
    file.seek(0)
    lines = file.read(1 << 16).decode(errors="replace").strip().splitlines()
    return lines[-1].strip().rstrip(".") if lines else ""
