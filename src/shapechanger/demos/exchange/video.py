"""Write and read videos of datasets.

An untrusted video is opened as a file object and as MP4 only, so that it cannot refer to other
files. Images with too many pixels and damaged images are refused.
"""

from __future__ import annotations

import re
from collections.abc import Generator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange.files import MAX_UNPACKED, library
from shapechanger.demos.jpeg import MAX_PIXELS
from shapechanger.errors import DemosError, OutputError, translate_errors

# `crf` is the quality, from 0 (lossless) to 51; docs/exchange.md has the measured error. Every
# second image is a key frame, so that learners can read single images quickly.
_CODING: Final = {"crf": "18", "g": "2", "bf": "0"}
_MAX_SAMPLES: Final = 1 << 21  # 10 hours of images at 60 Hz, for which FFmpeg's index has 50 MB.


class VideoWriter:
    """Writer of an H.264 video of `frames` images with 4:2:0 colours and a constant rate."""

    def __init__(self, path: Path, size: tuple[int, int], rate: Fraction) -> None:
        width, height = size
        if width % 2 or height % 2:
            text = f"A video needs an even width and height, got {width} x {height} pixels"
            raise DemosError(f"{text}: export them with --images.")
        self.frames = 0
        self._path = path
        self._period_s = 1 / rate
        self._av = library("av", "lerobot")
        to = {"format": "mp4", "options": {"movflags": "+faststart"}}
        self._file = self._av.open(f"file:{path.absolute()}", "w", **to)
        about = {"width": width, "height": height, "pix_fmt": "yuv420p"}
        self._images = self._file.add_stream("libx264", rate, options=_CODING, **about)

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """Append an image, shape (height, width, 3)."""
        frame = self._av.VideoFrame.from_ndarray(pixels, format="rgb24")
        frame = frame.reformat(format="yuv420p", interpolation="BICUBIC")
        frame.pts, frame.time_base = self.frames, self._period_s
        self._file.mux(self._images.encode(frame))
        self.frames += 1

    def close(self) -> None:
        """Finish the file, and check that it is complete."""
        self._file.mux(self._images.encode(None))
        self._file.close()
        if (written := len(read_times(self._path).ticks)) != self.frames:
            raise OutputError(f"Cannot write {self._path}: it has {written} images.")


class VideoTimes(NamedTuple):
    """When the images of a video are shown, in ticks of its clock."""

    ticks: NDArray[np.int64]  # Ascending, shape (n,).
    keys: NDArray[np.int64]  # Decoding times of the key frames to start from, shape (n,).
    tick_s: Fraction
    size: tuple[int, int]  # Width and height, pixels.

    @property
    def seconds(self) -> NDArray[np.float64]:
        """The times in seconds."""
        return self.ticks.astype(np.float64) * float(self.tick_s)


def _require_whole(path: Path) -> None:
    """Refuse an MP4 file that is cut off, or has tables that are too large, long or compressed.

    Before FFmpeg reads a sample, it allocates an entry for each claimed sample, as many again for
    each edit, and for sound one per 1024 samples of a chunk (ISO/IEC 14496-12, 4.2, 8.6-8.8).
    """
    at, size, tables = 0, path.stat().st_size, bytearray()
    with path.open("rb") as file:
        while at < size:
            file.seek(at)
            head = file.read(16)
            length = int.from_bytes(head[:4], "big")
            length = int.from_bytes(head[8:], "big") if length == 1 else length or size - at
            if length < 8 or at + length > size:
                raise DemosError(f"{path} is damaged or cut off at byte {at}.")
            if head[4:8] != b"mdat":
                if len(tables) + length > MAX_UNPACKED:
                    raise DemosError(f"{path} has tables of more than {MAX_UNPACKED} bytes.")
                file.seek(at)
                tables += file.read(length)
            at += length

    def claimed(kinds: bytes, offset: int) -> int:
        ends = [match.end() + offset for match in re.finditer(kinds, tables)]
        return sum(int.from_bytes(tables[end : end + 4], "big") for end in ends)

    samples = claimed(b"stsz|stz2", 8) + claimed(b"trun", 4)
    for match in re.finditer(b"stsc", tables):
        runs = 12 * int.from_bytes(tables[match.end() + 4 :][:4], "big")
        table = tables[match.end() + 8 :][:runs]
        each = np.frombuffer(table[: len(table) // 12 * 12], ">u4")[1::3]
        samples += int(each.max(initial=0)) // 1024 * claimed(b"stco|co64", 4)
    if samples * (1 + claimed(b"elst", 4)) > _MAX_SAMPLES or b"cmov" in tables:
        text = f"{path} claims to have more than {_MAX_SAMPLES} images"
        raise DemosError(f"{text}, or has compressed tables.")


@contextmanager
def _opened(path: Path) -> Generator[tuple[Any, Any]]:
    """Open an untrusted MP4 file; yield the container and its first video stream."""
    av = library("av", "lerobot")
    _require_whole(path)
    strict = {"max_pixels": str(MAX_PIXELS), "err_detect": "explode"}
    with (
        translate_errors(
            av.FFmpegError,
            OSError,
            to=lambda error: DemosError(f"{path} is damaged: {error.strerror}."),
        ),
        path.open("rb") as file,
        av.open(file, format="mov", options=strict, metadata_errors="replace") as container,
    ):
        stream = next(iter(container.streams.video), None)
        if stream is None or stream.codec_context is None:
            raise DemosError(f"{path} has no images that can be decoded: restore it.")
        stream.codec_context.options = strict
        stream.codec_context.thread_count = 1  # Several threads would miss errors in slices.
        yield container, stream


def read_times(path: Path) -> VideoTimes:
    """Read the times of the images of an MP4 video, without decoding them."""
    most = path.stat().st_size
    found: list[tuple[int, int, bool, bool]] = []
    with _opened(path) as (container, stream):
        read = 0
        for packet in container.demux(stream):
            if packet.pts is not None and packet.dts is not None:
                # The edit list of the file may discard packets.
                shown = not packet.is_corrupt and not packet.is_discard
                found.append((packet.pts, packet.dts, packet.is_keyframe, shown))
                read += max(1, packet.size)
            if read > most:
                raise DemosError(f"{path} claims to have more than its {most} bytes.")
        codec = stream.codec_context
        form: Any = codec.format
        if form is not None and len(form.components) < 3 and form.components[0].bits > 8:
            raise DemosError(f"{path} has grey images of more than 8 bits ({form.name}).")
        ticks, dts, is_key, shown = np.array(sorted(found), np.int64).reshape(-1, 4).T
        if not shown.any():
            raise DemosError(f"{path} has no images: restore it.")
        keys = dts[np.maximum.accumulate(np.where(is_key, np.arange(len(dts)), 0))]
        ticks, keys = ticks[shown > 0], keys[shown > 0]
        if (np.diff(ticks) == 0).any():
            raise DemosError(f"{path} has two images at one time.")
        return VideoTimes(ticks, keys, stream.time_base, (codec.width, codec.height))


def read_pictures(
    path: Path, times: VideoTimes, wanted: NDArray[np.int64]
) -> Generator[NDArray[np.uint8]]:
    """Yield the images of an MP4 video at ascending times in ticks, shape (height, width, 3)."""
    with _opened(path) as (container, stream):
        key = times.keys[np.searchsorted(times.ticks, wanted[0])]
        container.seek(int(key), stream=stream)
        frames = container.decode(stream)
        shown = next(frames, None)
        for tick in wanted.tolist():
            while shown is not None and (shown.pts is None or shown.pts < tick):
                shown = next(frames, None)
            if shown is None or shown.pts != tick or shown.is_corrupt:
                raise DemosError(f"{path} is damaged: it has no image at {tick} ticks.")
            if (shown.width, shown.height) != times.size:
                raise DemosError(f"{path} has images of several sizes.")
            yield shown.to_ndarray(format="rgb24", interpolation="BICUBIC")
