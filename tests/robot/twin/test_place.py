"""Worlds for the vehicle of a twin: the plain room, or a MuJoCo course."""

import subprocess
import sys
from pathlib import Path

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.signals import read_ledger
from shapechanger.robot.twin.start import start_board
from shapechanger.vehicles.twin import course_place
from tests.robot.twin.robots import CAR

pytestmark = pytest.mark.realtime

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


def test_an_operator_lays_out_courses(tmp_path: Path) -> None:
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
        with pytest.raises(RobotError, match="Seeds of courses count from 0"):
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
    with pytest.raises(RobotError, match="did not start"):
        start_board(CAR, "twin", tmp_path, place=course_place("corridor", "tank"))
    assert "a tank is driven by 'left track' and 'right track'" in capfd.readouterr().err
