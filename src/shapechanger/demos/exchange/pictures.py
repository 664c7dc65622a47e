"""Read images and videos of datasets, check them, and convert them to JPEG; write videos.

Videos are written and read through PyAV. An untrusted video is opened as a file object and as MP4
only, so that it cannot refer to other files. Its images are decoded up to a limit of pixels, and
damaged images are refused instead of being concealed.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, Step
from shapechanger.demos.episodes.records import MAX_PICTURE_BYTES
from shapechanger.demos.exchange.files import MAX_UNPACKED, library
from shapechanger.demos.exchange.format import ExchangeStep, ImportContext, SourceRecord, counted
from shapechanger.demos.jpeg import MAX_PIXELS, decode_picture, encode_picture
from shapechanger.errors import (
    DemosError,
    MissingExtra,
    OutputError,
    ShapechangerError,
    UnknownName,
    translate_errors,
)
from shapechanger.files import read_file

_JPEG: Final = b"\xff\xd8"
_PNG: Final = b"\x89PNG"
_PNG_DEPTH: Final = slice(24, 25)  # Position of the number of bits of a value.
_OPAQUE: Final = 255
_MAX_SAMPLES: Final = 1 << 21  # Of a video: 10 hours at 60 Hz, and 50 MB of FFmpeg's index.


class PictureError(DemosError):
    """An image cannot be imported; the message follows a noun, such as "with an empty image"."""


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
    data = b""
    if isinstance(picture, np.ndarray):
        pixels = picture
    else:
        reason = "with an image that cannot be read ({})"
        with translate_errors(
            OSError, to=lambda error: PictureError(reason.format(error.strerror or error))
        ):
            read = isinstance(picture, Path)
            data = read_file(picture, MAX_PICTURE_BYTES) if read else picture or b""
        if not data.strip(b"\0"):
            raise PictureError("with an empty image")
        if len(data) > MAX_PICTURE_BYTES:
            raise PictureError(f"with an image of more than {MAX_PICTURE_BYTES} bytes")
        try:
            pixels = decode_picture(data, "") if data.startswith(_JPEG) else _pixels(data)
        except (PictureError, MissingExtra):
            raise
        except Exception as error:  # Pillow's errors have no common base.
            raise PictureError("with a damaged image") from error
    found, is_jpeg = (pixels.shape[1], pixels.shape[0]), data.startswith(_JPEG)
    if size is not None and found != size:
        raise PictureError(other_size(found, size))
    return data if is_jpeg else encode_picture(pixels), found, not is_jpeg


def other_size(found: Sequence[int], size: Sequence[int]) -> str:
    """Return the reason to leave out an image of another size, each in pixels."""
    return "with an image of {} x {} pixels, and not {} x {}".format(*found, *size)


def _pixels(data: bytes) -> NDArray[np.uint8]:
    """Decode a PNG or BMP of 8 bits, shape (height, width, 3)."""
    if not data.startswith((_PNG, b"BM")):
        raise PictureError("with an image that is not JPEG, PNG or BMP")
    if data.startswith(_PNG) and data[_PNG_DEPTH] == b"\x10":
        raise PictureError("with an image of more than 8 bits a value, like that of a depth camera")
    with library("PIL.Image").open(io.BytesIO(data), formats=["PNG", "BMP"]) as opened:
        if opened.width * opened.height > MAX_PIXELS:
            raise PictureError(f"with an image of more than {MAX_PIXELS} pixels")
        alpha = opened.convert("RGBA") if opened.has_transparency_data else None
        if alpha is not None and np.asarray(alpha)[..., 3].min() < _OPAQUE:
            raise PictureError("with an image that is partly transparent")
        return np.asarray(opened.convert("RGB"))


def rows_of(
    records: Iterable[SourceRecord],
    size: tuple[int, int] | None,
    context: ImportContext,
    what: str,
    rest: Sequence[str] = (),
) -> Iterator[ExchangeStep]:
    """Yield the steps of the records that are whole; the others are reported.

    Args:
        records: The records of an episode in order.
        size: Width and height of the images, pixels; None to leave out images.
        context: Collects what is left out.
        what: A record, as a noun for reports.
        rest: Names of all records, of which those are reported that a damaged file does not have.
    """
    shown: object = None
    done = 0
    try:
        for done, record in enumerate(records, 1):  # noqa: B007
            frame = record.picture if record.frame is None else record.frame
            jpeg, fault = None, record.fault or _fault(record.step)
            if size is not None and record.picture is not None and frame != shown and not fault:
                try:
                    jpeg, *_ = load_jpeg(record.picture, size)
                except PictureError as error:
                    fault = str(error)
            if fault:
                context.leave_out(what, fault, record.name)
                continue
            shown = shown if jpeg is None else frame
            yield ExchangeStep(
                step=record.step, jpeg=jpeg, marks=record.marks, dropped=record.dropped
            )
    except DemosError as error:
        for name in rest[done:]:
            context.leave_out(what, unreadable(error), name)


def unreadable(error: ShapechangerError) -> str:
    """Return a reason to leave a part out, after a noun."""
    return f"that cannot be read ({str(error).removesuffix('.')})"


def _fault(step: Step) -> str:
    if not all(map(isfinite, step.action)):
        return "with an action that is not finite"
    if step.driver not in DRIVERS:
        return unreadable(UnknownName("driver", step.driver, DRIVERS))
    return ""


def with_pictures(
    records: Sequence[SourceRecord], what: str, context: ImportContext
) -> tuple[list[SourceRecord], tuple[int, int] | None]:
    """Return the records with a whole image, or with none, and the most frequent size.

    All images are decoded, so that rates and jumps follow from the records that remain.
    """
    sizes: dict[int, tuple[int, int]] = {}
    encoded = 0
    for place, record in enumerate(records):
        if record.picture is not None and not record.fault:
            try:
                _, sizes[place], is_new = load_jpeg(record.picture)
                encoded += is_new
            except PictureError as error:
                record.fault = str(error)
    common = Counter(sizes.values()).most_common(1)[0][0] if sizes else None
    for place, record in enumerate(records):
        if common is not None and (size := sizes.get(place, common)) != common:
            record.fault = other_size(size, common)
        if record.fault:
            context.leave_out(what, record.fault, record.name)
    if encoded:
        context.note(f"{counted(encoded, 'image')} encoded as JPEG of quality 100.")
    return [record for record in records if not record.fault], common


class VideoWriter:
    """Writer of a video in H.264, with 4:2:0 colours and a constant rate.

    Args:
        path: The file to create.
        size: Width and height in pixels; both even.
        rate: Images per second.

    Attributes:
        frames: Number of images written.
    """

    # The quality of `crf` is constant, 0 to 51; see the measured error in docs/exchange.md. Each
    # second image is a key frame, so that learners can read any quickly.
    _CODING: Final = {"crf": "18", "g": "2", "bf": "0"}

    def __init__(self, path: Path, size: tuple[int, int], rate: Fraction) -> None:
        width, height = size
        if width % 2 or height % 2:
            raise DemosError(
                f"A video needs an even width and height, and the images have {width} x "
                f"{height} pixels: export them with --images."
            )
        self.frames = 0
        self._path = path
        self._period_s = 1 / rate
        self._av = library("av", "lerobot")
        to = {"format": "mp4", "options": {"movflags": "+faststart"}}
        self._file = self._av.open(f"file:{path.absolute()}", "w", **to)
        about = {"width": width, "height": height, "pix_fmt": "yuv420p"}
        self._images = self._file.add_stream("libx264", rate, options=self._CODING, **about)

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
            raise OutputError(
                f"Cannot write {self._path}: it has {written} of {self.frames} images."
            )


@dataclass(frozen=True, slots=True)
class VideoTimes:
    """When the images of a video are shown, in ticks of its clock.

    Attributes:
        ticks: Times, ascending, shape (n,).
        seconds: The same in seconds.
        keys: Decoding time of the key frame from which to decode each image, shape (n,).
        tick_s: Length of a tick, s.
        size: Width and height of the images, pixels.
    """

    ticks: NDArray[np.int64]
    seconds: NDArray[np.float64]
    keys: NDArray[np.int64]
    tick_s: Fraction
    size: tuple[int, int]


def _require_whole(path: Path) -> None:
    """Refuse an MP4 file that is cut off, or whose tables claim far more than it can hold.

    FFmpeg allocates an entry for each sample that is claimed, again for each edit, and instead of
    samples of sound for each 1024 in a chunk, before any is read (ISO/IEC 14496-12, 4.2, 8.6-8.8).
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
    in_chunks = 0
    for match in re.finditer(b"stsc", tables):
        runs = tables[match.end() + 8 :][
            : 12 * int.from_bytes(tables[match.end() + 4 :][:4], "big")
        ]
        each = np.frombuffer(runs[: len(runs) // 12 * 12], ">u4")[1::3]
        in_chunks += int(each.max(initial=0)) // 1024 * claimed(b"stco|co64", 4)
    if (samples + in_chunks) * (1 + claimed(b"elst", 4)) > _MAX_SAMPLES or b"cmov" in tables:
        raise DemosError(f"{path} claims to have more than {_MAX_SAMPLES} images.")


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
        stream.codec_context.thread_count = 1  # Several threads would lose errors of slices.
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
            raise DemosError(
                f"{path} has grey images of more than 8 bits ({form.name}), like those of "
                "a depth camera, which cannot be imported."
            )
        ticks, dts, is_key, shown = np.array(sorted(found), np.int64).reshape(-1, 4).T
        if not shown.any():
            raise DemosError(f"{path} has no images: restore it.")
        keys = dts[np.maximum.accumulate(np.where(is_key, np.arange(len(dts)), 0))]
        ticks, keys = ticks[shown > 0], keys[shown > 0]
        if (np.diff(ticks) == 0).any():
            raise DemosError(f"{path} has two images at one time.")
        seconds = ticks.astype(np.float64) * float(stream.time_base)
        size = (codec.width, codec.height)
        return VideoTimes(ticks, seconds, keys, stream.time_base, size)


def read_pictures(
    path: Path, times: VideoTimes, wanted: NDArray[np.int64]
) -> Generator[NDArray[np.uint8]]:
    """Yield the images of an MP4 video at some of its times, which ascend, in ticks.

    Their shape is (height, width, 3).
    """
    with _opened(path) as (container, stream):
        key = times.keys[np.searchsorted(times.ticks, wanted[0])]
        container.seek(int(key), stream=stream)
        frames = container.decode(stream)
        shown = next(frames, None)
        for tick in wanted.tolist():
            while shown is not None and (shown.pts is None or shown.pts < tick):
                shown = next(frames, None)
            if shown is None or shown.pts != tick or shown.is_corrupt:
                at_s = float(tick * times.tick_s)
                raise DemosError(f"{path} is damaged: it has no image at {at_s:.3f} s.")
            if (shown.width, shown.height) != times.size:
                raise DemosError(f"{path} has images of several sizes.")
            yield shown.to_ndarray(format="rgb24", interpolation="BICUBIC")
