"""Worlds and front camera of a twin."""

import os
import re
import select
import subprocess
import sys
import time
from pathlib import Path
from typing import BinaryIO

import pytest
import simplejpeg

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.ledger import read_ledger
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.start import BoardAt, start_board
from shapechanger.vehicles.twin import course_place
from tests.robot.cameras.frames import read_barcode
from tests.robot.twin.robots import CAR, until

pytestmark = pytest.mark.realtime

_CAMERA = CameraPlan("pipe", fps=20.0)


def _open(board: BoardAt) -> BinaryIO:
    return os.fdopen(os.open(board.fifo_path, os.O_RDONLY | os.O_NONBLOCK), "rb", buffering=0)


def _pictures(data: bytes) -> list[tuple[int, bytes]]:
    found = re.finditer(
        rb"\xff\xd8\xff\xfe..captured_ns=(\d+)\xff.*?\xff\xd9(?=\xff\xd8|$)", data, re.S
    )
    return [(int(one[1]), one[0]) for one in found]


def test_frames_contain_their_capture_time(tmp_path: Path) -> None:
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


def test_in_real_time_the_pipe_holds_one_frame_only(tmp_path: Path) -> None:
    """After a pause, a reader gets one frame, because the frames after it were dropped."""
    with (
        start_board(CAR, "real", tmp_path, CameraPlan("pipe", fps=100.0)) as board,
        _open(board) as pipe,
    ):
        until(lambda: bool(select.select([pipe], [], [], 0.0)[0]))
        first_ns = time.monotonic_ns()
        until(lambda: time.monotonic_ns() > first_ns + 100_000_000)
        assert len(_pictures(pipe.read(1 << 20))) == 1


_CORRIDOR = course_place("corridor", "car")


def test_the_room_does_not_import_mujoco() -> None:
    script = (
        "import sys\n"
        "sys.modules['mujoco'] = None\n"
        "from shapechanger.errors import MissingExtra\n"
        "from shapechanger.robot.twin.start import Place, open_world\n"
        "open_world(Place(), {'wheels'}, None, 1)\n"
        "try:\n"
        "    open_world(Place('shapechanger.vehicles.twin:open_course'), {'wheels'}, None, 1)\n"
        "except MissingExtra as error:\n"
        "    print(error)"
    )
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], check=True, capture_output=True, text=True
    )
    assert run.stdout.endswith("run `pip install 'shapechanger[sim]'`.\n")


def test_an_operator_replaces_the_course(tmp_path: Path) -> None:
    with (
        start_board(CAR, "twin", tmp_path, seed=4, place=_CORRIDOR) as board,
        Operator(board.socket_path) as operator,
    ):
        first = operator.where()
        assert first.truth == {"progress_m": 0.0, "collisions": 0.0}
        operator.lay_out(5)
        other = operator.where()
        assert (other.x, other.y) != (first.x, first.y)
        # The board survives an invalid request.
        with pytest.raises(RobotError, match="seed of a course must be at least 0"):
            operator.lay_out(-1)
        operator.lay_out(4)
        again = operator.where()
        assert (again.x, again.y, again.heading) == (first.x, first.y, first.heading)
        laid_out = [one.seed for one in read_ledger(board.ledger_path) if one.kind == "course"]
    assert laid_out == [5, 4]


def test_an_invalid_operator_request_keeps_the_board_running(tmp_path: Path) -> None:
    camera = CameraPlan("pipe", fps=20.0)
    with start_board(CAR, "twin", tmp_path) as board, Operator(board.socket_path) as operator:
        with pytest.raises(RobotError, match="no camera"):
            operator.break_camera("off")
        with pytest.raises(RobotError, match="without a camera"):
            board.camera_plan(camera)
    seeing = tmp_path / "seeing"
    seeing.mkdir()
    with start_board(CAR, "twin", seeing, camera) as board, Operator(board.socket_path) as operator:
        with pytest.raises(RobotError, match="No fault of a camera matches 'of'"):
            operator.break_camera("of")  # pyright: ignore[reportArgumentType]  # Invalid on purpose.
        assert operator.advance(0.1) > 0


def test_a_board_that_fails_to_start_prints_the_reason(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    place = course_place("corridor", "tank")
    with (
        pytest.raises(RobotError, match="did not start"),
        start_board(CAR, "twin", tmp_path, place=place),
    ):
        pass
    assert "a tank is driven by 'left track' and 'right track'" in capfd.readouterr().err
