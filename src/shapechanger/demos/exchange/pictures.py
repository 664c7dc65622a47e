"""Pictures and videos of other projects: checked, and converted to JPEG if needed.

MP4 videos are written and read by an FFmpeg process, the program of imageio-ffmpeg. Files of
strangers are decoded in that process and not in this one: as MP4 only, without references to other
files, and with a limit of pixels.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import tempfile
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import IO, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES, read_file
from shapechanger.demos.exchange.files import library
from shapechanger.demos.jpeg import MAX_PIXELS, decode_picture, encode_picture
from shapechanger.errors import DemosError, OutputError

_JPEG: Final = b"\xff\xd8"
_MAGIC: Final = {b"\x89PNG": "PNG", b"BM": "BMP"}
_DEEP: Final = ("I", "F")  # Pillow's modes of more than 8 bits.
_PNG_DEPTH: Final = slice(24, 25)  # Position of the number of bits of a value.
_OPAQUE: Final = 255


class PictureError(DemosError):
    """An image that cannot be imported.

    Attributes:
        reason: Why, after a noun, such as "with an empty image".
    """

    def __init__(self, reason: str) -> None:
        super().__init__(f"A record {reason} cannot be imported.")
        self.reason = reason


def load_jpeg(
    picture: Path | bytes | NDArray[np.uint8] | None, size: tuple[int, int] | None = None
) -> tuple[bytes, tuple[int, int], bool]:
    """Return an intact image as JPEG, its width and height, and whether it was encoded.

    Images are encoded with quality 100.

    Args:
        picture: A file, or the content of one: JPEG, PNG or BMP; or pixels, shape
            (height, width, 3).
        size: Width and height that it must have, pixels; None for any.

    Raises:
        PictureError: If it is missing, damaged, of another kind or size, or too large.
    """
    if isinstance(picture, np.ndarray):
        pixels, encoded, jpeg = picture, True, encode_picture(picture)
    else:
        data = _read(picture) if isinstance(picture, Path) else picture or b""
        if not data.strip(b"\0"):
            raise PictureError("with an empty image")
        if len(data) > MAX_PICTURE_BYTES:
            raise PictureError(f"with an image of more than {MAX_PICTURE_BYTES} bytes")
        encoded = not data.startswith(_JPEG)
        try:
            pixels = _pixels(data) if encoded else decode_picture(data, "")
        except PictureError:
            raise
        except DemosError as error:
            raise PictureError("with a damaged image") from error
        jpeg = encode_picture(pixels) if encoded else data
    found = (pixels.shape[1], pixels.shape[0])
    if size is not None and found != size:
        raise PictureError(other_size(found, size))
    return jpeg, found, encoded


def other_size(found: Sequence[int], size: Sequence[int]) -> str:
    """Return the reason to leave out an image of another size, each in pixels."""
    return "with an image of {} x {} pixels, and not {} x {}".format(*found, *size)


def _read(path: Path) -> bytes:
    try:
        return read_file(path, MAX_PICTURE_BYTES)
    except FileNotFoundError as error:
        raise PictureError("with an image that is missing") from error
    except OSError as error:
        reason = f"with an image that cannot be read ({error.strerror or error})"
        raise PictureError(reason) from error


def _pixels(data: bytes) -> NDArray[np.uint8]:
    """Decode a PNG or BMP of 8 bits, shape (height, width, 3)."""
    form = next((form for magic, form in _MAGIC.items() if data.startswith(magic)), "")
    if not form:
        raise PictureError("with an image that is not JPEG, PNG or BMP")
    image = library("PIL.Image")
    try:
        with image.open(io.BytesIO(data), formats=[form]) as opened:
            if opened.width * opened.height > MAX_PIXELS:
                raise PictureError(f"with an image of more than {MAX_PIXELS} pixels")
            if opened.mode.startswith(_DEEP) or (form == "PNG" and data[_PNG_DEPTH] == b"\x10"):
                raise PictureError(
                    "with an image of more than 8 bits a value, like that of a depth camera"
                )
            alpha = opened.convert("RGBA") if opened.has_transparency_data else None
            if alpha is not None and np.asarray(alpha)[..., 3].min() < _OPAQUE:
                raise PictureError("with an image that is partly transparent")
            return np.asarray(opened.convert("RGB"))
    except PictureError:
        raise
    except Exception as error:  # Pillow's errors have no common base.
        raise PictureError("with a damaged image") from error


# Constant quality, 0 to 51; see the measured error in docs/exchange.md.
_QUALITY: Final = 18
_KEY_FRAMES: Final = 2  # Each second image stands alone, so that learners can read any quickly.
_LONGEST_LINE: Final = 256
_FLAGS: Final = re.compile(rb"F=0x([0-9A-F]+)")
_LEFT_OUT: Final = 0x2 | 0x4  # Flags of packets: damaged, or cut off by the list of edits.
_PIXELS: Final = re.compile(rb"Stream #0:.*: Video: [^,]*, (\w+)")


def _ffmpeg(arguments: Sequence[str], log: str = "error") -> list[str]:
    """Return the command line of FFmpeg, with the level of its log."""
    try:
        path = cast("str", library("imageio_ffmpeg", "lerobot").get_ffmpeg_exe())
    except RuntimeError as error:  # Where its wheel brings none.
        raise DemosError(f"Videos need FFmpeg: {error}") from error
    return [path, "-hide_banner", "-nostats", "-loglevel", log, "-nostdin", *arguments]


class VideoWriter:
    """Writer of a video in H.264, with 4:2:0 colours and a constant rate.

    Args:
        path: The file to create.
        size: Width and height in pixels; both even.
        rate: Images per second.

    Attributes:
        frames: Number of images written.
    """

    CODEC: Final = "h264"
    PIXELS: Final = "yuv420p"

    def __init__(self, path: Path, size: tuple[int, int], rate: Fraction) -> None:
        width, height = size
        if width % 2 or height % 2:
            raise DemosError(
                f"A video needs an even width and height, and the images have {width} x "
                f"{height} pixels: export them with --images."
            )
        _ffmpeg([])
        self.frames = 0
        self._path = path
        coding = ["-crf", str(_QUALITY), "-g", str(_KEY_FRAMES), "-bf", "0"]
        self._pictures: Any = library("imageio_ffmpeg", "lerobot").write_frames(
            str(path.absolute()),
            size,
            fps=float(rate),
            quality=None,
            codec="libx264",
            macro_block_size=1,
            ffmpeg_log_level="quiet",
            # Which of two rates counts is the last one; the first is rounded.
            input_params=["-r", f"{rate.numerator}/{rate.denominator}"],
            output_params=[*coding, "-movflags", "+faststart"],
        )

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Append an image, shape (height, width, 3)."""
        try:
            if not self.frames:
                self._pictures.send(None)  # It starts FFmpeg.
            self._pictures.send(np.ascontiguousarray(pixels))
        except OSError as error:
            raise OutputError(f"Cannot write {self._path}: FFmpeg ended.") from error
        self.frames += 1

    def close(self) -> None:
        """Finish the file, and check that it is whole."""
        self._pictures.close()
        written = 0
        with contextlib.suppress(DemosError, OSError):
            written = len(read_times(self._path).ticks) if self.frames else 0
        if self.frames != written:
            raise OutputError(
                f"Cannot write {self._path}: it has {written} of {self.frames} images."
            )


@dataclass(frozen=True, slots=True)
class VideoTimes:
    """When each image of a video is shown.

    Attributes:
        ticks: Times in ticks, ascending, shape (n,).
        tick_s: Length of a tick, s.
        size: Width and height of the images, pixels.
        is_cut_off: Whether the end of the file is missing.
    """

    ticks: NDArray[np.int64]
    tick_s: Fraction
    size: tuple[int, int]
    is_cut_off: bool

    @property
    def seconds(self) -> NDArray[np.float64]:
        """Times in seconds, shape (n,)."""
        return self.ticks.astype(np.float64) * float(self.tick_s)


def read_times(path: Path) -> VideoTimes:
    """Read the times of the images of an MP4 video, without decoding them."""
    taken = ["-map", "0:v:0", "-c", "copy", "-copyinkf", "-f", "framecrc", "pipe:1"]
    command = _ffmpeg([*_reading(path), *taken], log="info")
    ticks: list[int] = []
    about: dict[str, str] = {}
    most = path.stat().st_size  # Each image has at least one byte.
    with tempfile.TemporaryFile() as log, _running(command, log) as (process, stream):
        for line in iter(lambda: stream.readline(_LONGEST_LINE), b""):
            if line.startswith(b"#"):
                name, _, value = line[1:].decode(errors="replace").partition(":")
                about[name.strip()] = value.strip()
            elif not (flags := _FLAGS.search(line)) or not int(flags[1], 16) & _LEFT_OUT:
                # A packet: "stream, decoding time, presentation time, ...".
                ticks.append(int(line.split(b",")[2]))
            if len(ticks) > most:
                raise DemosError(f"{path} claims more images than it has bytes.")
        process.wait()
        if not ticks or process.returncode:
            raise DemosError(f"{path} has no images{_problem(log)}: restore it.")
        log.seek(0)
        said = log.read(1 << 20)
    found = _PIXELS.search(said)
    pixels = found[1].decode() if found else "unknown"
    if pixels.startswith(("gray", "ya")) and pixels.endswith(("le", "be")):
        raise DemosError(
            f"{path} has grey images of more than 8 bits ({pixels}), like those of a depth "
            "camera, which cannot be imported."
        )
    try:
        width, height = (int(n) for n in about["dimensions 0"].split("x"))
        tick_s = Fraction(about["tb 0"])
    except (KeyError, ValueError, ZeroDivisionError) as error:
        raise DemosError(f"{path} has no size and no clock: restore it.") from error
    shown = np.unique(np.array(ticks, np.int64))
    return VideoTimes(shown, tick_s, (width, height), b"partial file" in said)


def read_pictures(
    path: Path,
    times: VideoTimes,
    wanted: Sequence[int],
    size: tuple[int, int],
    *,
    from_start: bool = False,
) -> Generator[NDArray[np.uint8]]:
    """Yield the images of an MP4 video at some times, shape (height, width, 3).

    Args:
        path: The file.
        times: Its times.
        wanted: The times to read, of those, ascending, in ticks.
        size: Width and height that the images must have, pixels.
        from_start: Whether to decode the video from its start, not from the key frame before.
    """
    width, height = size
    seek: list[str] = []
    if wanted[0] > times.ticks[0] and not from_start:
        # To the key frame before, by the file's own times; rounding must not miss it. An accurate
        # seek would add the time of the first image once more.
        since_s = float(wanted[0] * times.tick_s) - 1e-3
        seek = ["-noaccurate_seek", "-seek_timestamp", "1", "-ss", f"{since_s:.6f}"]
    read_fd, write_fd = os.pipe()
    taken = ["-map", "0:v:0", "-fps_mode", "passthrough"]
    # A line for each image, just before it: its time, as in the file.
    timed = ["-stats_enc_pre", f"pipe:{write_fd}", "-stats_enc_pre_fmt", "{ptsi}"]
    out = ["-f", "image2pipe", "-c:v", "ppm", "-pix_fmt", "rgb24", "pipe:1"]
    # Without these, damaged images would be filled up with others.
    strict = ["-xerror", "-err_detect", "explode"]
    command = _ffmpeg([*_reading(path, [*strict, *seek]), *taken, *timed, *out])
    with (
        tempfile.TemporaryFile() as log,
        os.fdopen(read_fd, "rb") as lines,
        _running(command, log, write_fd) as (process, stream),
    ):
        for tick in wanted:
            shown, data = _next_picture(path, size, lines, stream)
            while data and shown < tick:
                shown, data = _next_picture(path, size, lines, stream)
            if seek and tick == wanted[0] and shown != tick:  # That was no key frame.
                yield from read_pictures(path, times, wanted, size, from_start=True)
                return
            if not data or shown != tick:
                process.kill()
                raise DemosError(
                    f"{path} is damaged: the image at {float(tick * times.tick_s):.3f} s "
                    f"cannot be decoded{_problem(log)}."
                )
            yield np.frombuffer(data, np.uint8).reshape(height, width, 3)


def _next_picture(
    path: Path, size: tuple[int, int], lines: IO[bytes], stream: IO[bytes]
) -> tuple[int, bytes]:
    """Return the time of the next image in ticks, and its pixels; b"" at the end."""
    line = lines.readline(_LONGEST_LINE)
    if not line.strip():
        return 0, b""
    # Each image is a PPM: "P6", width and height, 255, and the pixels.
    head = [stream.readline(_LONGEST_LINE) for _ in range(3)]
    width, height = size
    if head[0] and head != [b"P6\n", f"{width} {height}\n".encode(), b"255\n"]:
        found = head[1].decode(errors="replace").strip().replace(" ", " x ")
        raise DemosError(
            f"The images in {path} have {found} pixels, but meta/info.json says {width} x {height}."
        )
    data = stream.read(width * height * 3)
    return int(line), data if len(data) == width * height * 3 else b""


def _reading(path: Path, seek: Sequence[str] = ()) -> list[str]:
    """Return the options to read a file of a stranger, with its own times."""
    limits = ["-protocol_whitelist", "file", "-max_pixels", str(MAX_PIXELS), "-copyts"]
    return [*limits, "-f", "mov", *seek, "-i", f"file:{path.absolute()}"]


@contextlib.contextmanager
def _running(
    command: Sequence[str], log: IO[bytes], *fds: int
) -> Generator[tuple[subprocess.Popen[bytes], IO[bytes]]]:
    """Run FFmpeg, to which some further descriptors are handed over, and end it."""
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, pass_fds=fds
    ) as process:
        for fd in fds:
            os.close(fd)
        try:
            assert process.stdout is not None
            yield process, process.stdout
        finally:
            with contextlib.suppress(OSError):
                process.kill()


def _problem(log: IO[bytes]) -> str:
    """Return the last line of FFmpeg's log in brackets, or nothing."""
    log.seek(0)
    lines = log.read(1 << 16).decode(errors="replace").strip().splitlines()
    return f" ({lines[-1].strip().rstrip('.')})" if lines else ""
