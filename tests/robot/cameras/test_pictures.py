"""Barcodes, checks and streams of frames; no camera is needed."""

import operator
from collections.abc import Iterable
from itertools import pairwise

import numpy as np
import pytest
import simplejpeg
from hypothesis import example, given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.cameras.jpeg import JpegSplitter, captured_ns_of, checked_frame
from shapechanger.robot.cameras.sources import barcode_rows, draw_barcode
from shapechanger.robot.daemon.camera import FrameChecks
from tests.robot.cameras.frames import jpeg_of, read_barcode, with_comment

_RNG = np.random.default_rng(20171121)


def _picture(width: int = 160, height: int = 120) -> np.ndarray:
    return _RNG.integers(0, 256, (height, width, 3), dtype=np.uint8)


@given(
    number=st.integers(0, 2**48 - 1),
    size=st.sampled_from([(96, 96), (128, 128), (160, 120), (320, 240), (640, 480)]),
    quality=st.sampled_from([20, 50, 80]),
    subsampling=st.sampled_from(["444", "420"]),
)
def test_barcode_survives_jpeg(
    number: int, size: tuple[int, int], quality: int, subsampling: str
) -> None:
    image = _picture(*size)
    below = image[barcode_rows(size[0]) :].copy()
    draw_barcode(image, number)
    assert read_barcode(image) == number
    np.testing.assert_array_equal(image[barcode_rows(size[0]) :], below)
    jpeg = simplejpeg.encode_jpeg(image, quality, colorsubsampling=subsampling)
    assert read_barcode(simplejpeg.decode_jpeg(jpeg)) == number


def test_a_frame_of_the_wrong_size_is_refused() -> None:
    with pytest.raises(RobotError, match="32 by 24 pixels; the profile sets 160 by 120"):
        checked_frame(jpeg_of(), 0, CameraPlan("file"))


@pytest.mark.parametrize("data", [b"", b"no picture", jpeg_of()[:-2], b"\xff\xd8 and \xff\xd9"])
def test_invalid_jpeg_is_refused(data: bytes) -> None:
    with pytest.raises(RobotError, match=r"(incomplete|invalid) JPEG"):
        checked_frame(data, 0, CameraPlan("file", size=(32, 24)))


def test_a_truncated_frame_is_not_rotated() -> None:
    """A rotation would re-encode the frame as a valid JPEG with grey blocks."""
    jpeg = simplejpeg.encode_jpeg(_picture(), 80, colorsubsampling="420")
    broken = jpeg[: len(jpeg) // 2] + b"\xff\xd9"
    with pytest.raises(RobotError, match="cannot be decoded"):
        checked_frame(broken, 0, CameraPlan("file", flip=True))
    assert FrameChecks().refusal(Frame(broken, 0)) != ""


def test_rotating_twice_restores_the_image() -> None:
    image = np.zeros((24, 32, 3), np.uint8)
    image[:8, :8] = 255
    plan = CameraPlan("file", (32, 24), jpeg_quality=95, flip=True)
    once = checked_frame(simplejpeg.encode_jpeg(image, 95), 0, plan).jpeg
    np.testing.assert_allclose(
        simplejpeg.decode_jpeg(once)[[-4, 4], [-4, 4]].mean(1), (255, 0), atol=50
    )
    twice = checked_frame(once, 0, plan).jpeg
    np.testing.assert_allclose(simplejpeg.decode_jpeg(twice), image, atol=30)


def _split(stream: bytes, cuts: Iterable[int] = ()) -> tuple[list[bytes], int]:
    """Return the frames of a stream that arrives in parts, and the number of bytes skipped."""
    splitter = JpegSplitter()
    found: list[bytes] = []
    for first, last in pairwise([0, *cuts, len(stream)]):
        splitter.feed(stream[first:last])
        while (jpeg := splitter.next()) is not None:
            found.append(jpeg)
    return found, splitter.skipped


def _with_thumbnail(jpeg: bytes, thumbnail: bytes) -> bytes:
    """Insert a thumbnail into a frame, in an Exif segment."""
    size = (len(thumbnail) + 8).to_bytes(2, "big")
    return jpeg[:2] + b"\xff\xe1" + size + b"Exif\0\0" + thumbnail + jpeg[2:]


_FRAMES = [
    jpeg_of(3),
    _with_thumbnail(jpeg_of(90), jpeg_of(5)),
    with_comment(jpeg_of(7), b"\xff\xd9"),
]
_BETWEEN = st.binary(max_size=40).filter(lambda data: b"\xff\xd8" not in data)


@given(between=st.lists(_BETWEEN, min_size=4, max_size=4), cuts=st.sets(st.integers(0, 3000)))
@example(between=[b"\xff", b"\xff\xff", b"\xff\xd9", b"--boundary\r\n\r\n"], cuts=set(range(3000)))
@example(between=[b""] * 4, cuts=set(range(3000)))
def test_a_stream_yields_its_frames_and_no_others(between: list[bytes], cuts: set[int]) -> None:
    stream = between[0] + b"".join(map(operator.add, _FRAMES, between[1:]))
    found, skipped = _split(stream, sorted(cut for cut in cuts if cut < len(stream)))
    assert found == _FRAMES
    # A final FF is kept, because it may begin the next frame.
    assert skipped == sum(map(len, between)) - between[-1].endswith(b"\xff")


@given(frame=st.sampled_from(_FRAMES), data=st.data())
def test_a_frame_that_is_cut_off_is_skipped(frame: bytes, data: st.DataObject) -> None:
    """Later frames are found once more bytes have arrived than the longest segment has."""
    cut = data.draw(st.integers(0, len(frame) - 1))
    after = [jpeg_of(value) for value in (1, 2)] * 60
    found, _ = _split(frame[:cut] + b"".join(after))
    # The thumbnail of an incomplete frame looks like a frame, and an incomplete segment may end
    # exactly at the end of the next frame.
    assert [jpeg for jpeg in found if jpeg != jpeg_of(5)] in (after, after[1:])


@given(garbage=st.binary(max_size=200))
def test_a_stream_recovers_after_garbage(garbage: bytes) -> None:
    """After bytes that look like the start of a frame, frames are found once enough follow."""
    found, _ = _split(jpeg_of(9)[:20] + garbage + jpeg_of(1) * 150)
    assert found.count(jpeg_of(1)) >= 30


def test_a_stream_without_frames_is_refused() -> None:
    for stream in (jpeg_of()[:-2] + bytes(4 << 20), bytes(2 << 20), b"\xff\xd8\xff\xd9" * 270_000):
        splitter = JpegSplitter()
        splitter.feed(stream)
        with pytest.raises(RobotError, match="without a complete JPEG"):
            splitter.next()
        splitter.feed(jpeg_of(7))
        assert splitter.next() == jpeg_of(7)


@pytest.mark.parametrize(
    ("comment", "time_ns"),
    [
        (b"captured_ns=1234567890123", 1234567890123),
        (b"captured_ns=soon", None),
        (b"x" * 100, None),
        (b"", None),
    ],
)
def test_the_capture_time_is_read_from_the_comment(comment: bytes, time_ns: int | None) -> None:
    assert captured_ns_of(with_comment(jpeg_of(), comment) if comment else jpeg_of()) == time_ns
