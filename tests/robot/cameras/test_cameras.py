"""Camera drivers; those that need hardware are tested with fakes."""

import ctypes
import fcntl
import mmap
import os
import sys
import threading
import time
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import simplejpeg

from shapechanger.errors import RobotError
from shapechanger.robot.cameras import v4l2 as api
from shapechanger.robot.cameras.camera import Camera, CameraPlan, Frame, open_camera
from shapechanger.robot.cameras.v4l2 import V4l2
from tests.robot.cameras.frames import jpeg_of, read_barcode, with_comment

pytestmark = pytest.mark.realtime


def _plan(driver: str, **settings: int | str) -> CameraPlan:
    return CameraPlan(driver, size=(32, 24), fps=1000.0, settings=settings)


def _ends_when_closed(camera: Camera, reads: Callable[[], object]) -> str:
    """Close a camera while a thread reads it, and return the message of the error."""
    text: list[str] = []

    def wait() -> None:
        try:
            while True:
                reads()
        except RobotError as error:
            text.append(str(error))

    thread = threading.Thread(target=wait)
    thread.start()
    camera.close()
    thread.join(10.0)
    assert not thread.is_alive()
    camera.close()  # Closing is idempotent.
    return text[0]


def test_the_pattern_changes_and_contains_its_time() -> None:
    """The barcode of each frame is its capture time, so that a receiver can measure its age."""
    camera = open_camera(CameraPlan("pattern", fps=100.0))
    frames = [camera.read() for _ in range(3)]
    for frame in frames:
        image = simplejpeg.decode_jpeg(frame.jpeg)
        assert image.shape == (120, 160, 3)
        assert read_barcode(image) == frame.captured_ns % 2**48
    times = [frame.captured_ns for frame in frames]
    assert times[2] - times[0] >= 19_000_000  # Two periods, with a tolerance for a late frame.
    assert len({frame.jpeg for frame in frames}) == 3
    assert _ends_when_closed(camera, camera.read) == "The camera is closed."


def test_a_folder_is_read_in_order_and_repeated(tmp_path: Path) -> None:
    """Images are sorted by name; other files are ignored."""
    for name, value in (("b.jpg", 90), ("a.jpg", 10), ("c.JPEG", 200)):
        (tmp_path / name).write_bytes(jpeg_of(value))
    (tmp_path / "notes.txt").write_text("no picture")
    camera = open_camera(_plan("file", path=str(tmp_path)))
    means = [round(simplejpeg.decode_jpeg(camera.read().jpeg).mean()) for _ in range(4)]
    assert means == [10, 90, 200, 10]
    assert "closed" in _ends_when_closed(camera, camera.read)


def test_a_bad_file_is_named_and_skipped(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"broken")
    (tmp_path / "b.jpg").write_bytes(jpeg_of(90))
    camera = open_camera(_plan("file", path=str(tmp_path)))
    with pytest.raises(RobotError, match=r"a\.jpg: .*an incomplete JPEG"):
        camera.read()
    assert camera.read().jpeg == jpeg_of(90)


@pytest.fixture
def fifo(tmp_path: Path) -> Path:
    path = tmp_path / "camera"
    os.mkfifo(path)
    return path


def test_a_pipe_returns_the_newest_frame_and_its_time(fifo: Path) -> None:
    """Older frames in the pipe are skipped, and so are bytes between frames, which are counted."""
    camera = open_camera(_plan("pipe", path=str(fifo)))
    old, new = (with_comment(jpeg_of(n), b"captured_ns=%d" % n) for n in (10, 90))
    with fifo.open("wb", buffering=0) as writer:
        writer.write(old + new)
        assert camera.read() == Frame(new, 90)
        before_ns = time.monotonic_ns()
        writer.write(b"garbage" + jpeg_of(40))
        frame = camera.read()
        assert (frame.jpeg, frame.skipped) == (jpeg_of(40), 7)
        assert before_ns <= frame.captured_ns <= time.monotonic_ns()
    with pytest.raises(RobotError, match="has ended"):
        camera.read()
    writing = threading.Thread(target=fifo.write_bytes, args=(jpeg_of(50),))
    writing.start()
    assert camera.read().jpeg == jpeg_of(50)  # This frame is from the next writer.
    writing.join()
    with pytest.raises(RobotError, match="has ended"):
        camera.read()
    assert _ends_when_closed(camera, camera.read) == "The camera is closed."


def test_frames_queued_in_the_pipe_are_skipped(fifo: Path) -> None:
    """Without a timestamp, queued frames would look new."""
    camera = open_camera(_plan("pipe", path=str(fifo)))
    noise = np.random.default_rng(1).integers(0, 256, (24, 32, 3), np.uint8)
    old = simplejpeg.encode_jpeg(noise, 95)
    with fifo.open("wb", buffering=0) as writer:
        fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, 1 << 18)
        count = 150_000 // len(old)  # Too many bytes for a single read.
        writer.write(old * count + jpeg_of(90) + jpeg_of(20)[:100])
        assert camera.read().jpeg == jpeg_of(90)
        writer.write(jpeg_of(20)[100:])
        assert camera.read().jpeg == jpeg_of(20)
        writer.write(jpeg_of(30))
    assert camera.read().jpeg == jpeg_of(30)  # New, although the writer has closed the pipe.
    with pytest.raises(RobotError, match="has ended"):
        camera.read()


class _Kernel:
    """A fake of the ioctl calls of a webcam, with buffers in a file."""

    def __init__(self, path: Path, size: tuple[int, int] = (32, 24)) -> None:
        path.write_bytes(bytes(3 * mmap.PAGESIZE))
        self._size = size
        self._path = path
        self.calls: list[int] = []
        self.pictures: list[tuple[bytes, int, int]] = []
        self._queued: list[int] = []

    def ioctl(self, fd: int, call: int, data: Any) -> int:
        self.calls.append(call)
        if call == api.SET_FORMAT:
            data.width, data.height = self._size
        elif call == api.QUERY_BUFFER:
            data.offset, data.length = data.index * mmap.PAGESIZE, mmap.PAGESIZE
        elif call == api.QUEUE:
            self._queued.append(data.index)
        elif call == api.DEQUEUE:
            if not self.pictures:
                raise BlockingIOError
            jpeg, at_ns, flags = self.pictures.pop(0)
            data.index, data.used, data.flags = self._queued.pop(0), len(jpeg), flags
            data.seconds, data.microseconds = 0, at_ns // 1000
            with self._path.open("r+b") as file:
                file.seek(data.index * mmap.PAGESIZE)
                file.write(jpeg)
        return 0


def test_structures_have_the_kernels_sizes() -> None:
    for structure, call, size in (
        (api.Buffer, api.QUEUE, 88),
        (api.PixelFormat, api.SET_FORMAT, 208),
        (api.Parameters, api.SET_PARAMETERS, 204),
        (api.BufferRequest, api.REQUEST_BUFFERS, 20),
    ):
        assert ctypes.sizeof(structure) == (call >> 16) & 0x3FFF == size
    # The sizes on a 64-bit kernel.
    assert (api.Buffer.seconds.offset, api.Buffer.memory.offset) == (24, 60)
    assert (api.Buffer.offset.offset, api.Buffer.length.offset) == (64, 72)
    assert api.PixelFormat.width.offset == 8
    assert api.Parameters.numerator.offset == 12


def test_a_webcam_returns_the_newest_frame_and_the_kernels_time(tmp_path: Path) -> None:
    kernel = _Kernel(tmp_path / "video0")
    camera = V4l2(_plan("v4l2", device=str(tmp_path / "video0")), kernel.ioctl)
    assert kernel.calls[-1] == api.STREAM_ON
    monotonic = api.BUFFER_FLAG_MONOTONIC
    kernel.pictures = [
        (jpeg_of(10), 1_000_000, monotonic),
        (jpeg_of(90) + bytes(20), 2_000_000, monotonic),
        (b"torn", 3_000_000, monotonic | api.BUFFER_FLAG_ERROR),
    ]
    assert camera.read() == Frame(jpeg_of(90), 2_000_000)
    kernel.pictures = [(jpeg_of(20), 5, 0)]  # A buffer of a driver without a monotonic clock.
    assert camera.read().captured_ns > 1_000_000_000
    camera.close()
    with pytest.raises(RobotError, match="closed"):
        camera.read()


@pytest.fixture
def pi(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """Fake picamera2 and libcamera packages, with one camera."""
    camera = Mock()
    request = camera.capture_request.return_value
    request.make_array.return_value = np.zeros((24, 32, 3), np.uint8)
    request.get_metadata.return_value = {"SensorTimestamp": 123_456_789, "ExposureTime": 10_000}
    fake = types.SimpleNamespace(Picamera2=lambda number: [camera][number], Transform=dict)
    monkeypatch.setitem(sys.modules, "picamera2", fake)
    monkeypatch.setitem(sys.modules, "libcamera", fake)
    return camera


def test_pi_camera_gives_jpeg_with_the_sensors_time(pi: Mock) -> None:
    plan = CameraPlan("picamera2", (32, 24), 25.0, 80, flip=True, settings={"number": 0})
    camera = open_camera(plan)
    pi.create_video_configuration.assert_called_once_with(
        main={"size": (32, 24), "format": "BGR888"},
        transform={"hflip": 1, "vflip": 1},
        queue=False,
        controls={"FrameDurationLimits": (40_000, 40_000)},
    )
    pi.configure.assert_called_once_with(pi.create_video_configuration.return_value)
    request = pi.capture_request.return_value
    request.make_array.return_value[..., 0] = 255  # Red.
    frame = camera.read()
    assert frame.captured_ns == 123_456_789
    np.testing.assert_allclose(simplejpeg.decode_jpeg(frame.jpeg)[12, 16], (255, 0, 0), atol=5)
    pi.capture_request.assert_called_once_with(wait=2.0)
    request.make_array.assert_called_once_with("main")
    request.release.assert_called_once_with()
    request.make_array.return_value = np.zeros((48, 64, 3), np.uint8)
    with pytest.raises(RobotError, match="64 by 48"):
        camera.read()
    assert request.release.call_count == 2
    pi.capture_request.side_effect = TimeoutError
    with pytest.raises(RobotError, match="sent no frame for 2 s"):
        camera.read()
    camera.close()
    camera.close()
    pi.stop.assert_called_once_with()
    pi.close.assert_called_once_with()
    with pytest.raises(RobotError, match="closed"):
        camera.read()
