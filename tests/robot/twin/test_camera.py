"""The front camera: timestamped JPEG frames written to a pipe."""

import os
import re
import select
import time
from pathlib import Path
from typing import BinaryIO

import pytest
import simplejpeg

from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.start import RunningBoard, start_board
from tests.robot.cameras.frames import read_barcode
from tests.robot.twin.robots import CAR, until

pytestmark = pytest.mark.realtime

_CAMERA = CameraPlan("pipe", fps=20.0)


def _open(board: RunningBoard) -> BinaryIO:
    return os.fdopen(os.open(board.fifo_path, os.O_RDONLY | os.O_NONBLOCK), "rb", buffering=0)


def _pictures(data: bytes) -> list[tuple[int, bytes]]:
    found = re.finditer(
        rb"\xff\xd8\xff\xfe..captured_ns=(\d+)\xff.*?\xff\xd9(?=\xff\xd8|$)", data, re.S
    )
    return [(int(one[1]), one[0]) for one in found]


def test_frames_carry_their_capture_time(tmp_path: Path) -> None:
    with (
        start_board(CAR, "twin", tmp_path, _CAMERA) as board,
        Operator(board.socket_path) as operator,
        _open(board) as pipe,
    ):
        start = operator.advance(0.0)
        operator.advance(1.0)
        pictures = _pictures(pipe.read(1 << 20))
    assert [t for t, _ in pictures] == [start + 50_000_000 * i for i in range(21)]
    for t, jpeg in pictures:
        image = simplejpeg.decode_jpeg(jpeg, "RGB")
        assert image.shape == (120, 160, 3)
        assert read_barcode(image) == t


def test_frames_without_a_reader_are_dropped(tmp_path: Path) -> None:
    with (
        start_board(CAR, "twin", tmp_path, _CAMERA) as board,
        Operator(board.socket_path) as operator,
    ):
        operator.advance(5.0)
        with _open(board) as pipe:
            now = operator.advance(0.1)
            assert all(t > now - 110_000_000 for t, _ in _pictures(pipe.read(1 << 20)))
        operator.advance(1.0)
        with _open(board):
            operator.advance(100.0)  # A full pipe does not stop the clock.


def test_in_real_time_the_pipe_holds_the_latest_frame_only(tmp_path: Path) -> None:
    """After a pause, a reader gets one frame, not a queue of old ones."""
    with (
        start_board(CAR, "real", tmp_path, CameraPlan("pipe", fps=100.0)) as board,
        _open(board) as pipe,
    ):
        until(lambda: bool(select.select([pipe], [], [], 0.0)[0]))
        first_ns = time.monotonic_ns()
        until(lambda: time.monotonic_ns() > first_ns + 100_000_000)
        assert len(_pictures(pipe.read(1 << 20))) == 1
