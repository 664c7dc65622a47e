"""Where the vehicle of a twin is: a plain room, or a place in MuJoCo."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from shapechanger.errors import ProfileError, RobotError, UnknownName, WorldError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.twin.robot import Operator
from shapechanger.twin.signals import read_ledger
from shapechanger.twin.start import start_board
from shapechanger.twin.world.place import Place, open_world
from shapechanger.twin.world.vehicle import DrivingWorld
from shapechanger.worlds.simulation import MujocoWorld
from tests.twin.robots import CAR

pytestmark = pytest.mark.realtime

_PARTS = {"wheels", "steering"}
_CORRIDOR = Place("corridor", "car")


def test_a_place_that_says_nothing_is_the_room() -> None:
    """It needs no MuJoCo, and counts nothing."""
    world = open_world(Place(), _PARTS, None, 1)
    assert isinstance(world, DrivingWorld)
    assert world.picture().shape == (120, 160, 3)
    assert world.truth() == {}


def test_the_room_does_without_mujoco() -> None:
    """A place that needs it names the extra to install."""
    script = (
        "import sys\n"
        "sys.modules['mujoco'] = None\n"
        "from shapechanger.errors import MissingExtra\n"
        "from shapechanger.twin.world.place import Place, open_world\n"
        "open_world(Place(), {'wheels'}, None, 1)\n"
        "try:\n"
        "    open_world(Place('corridor', 'car'), {'wheels', 'steering'}, None, 1)\n"
        "except MissingExtra as error:\n"
        "    print(error)"
    )
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], check=True, capture_output=True, text=True
    )
    assert run.stdout.endswith("run `pip install 'shapechanger[sim]'`.\n")


def test_a_place_in_mujoco() -> None:
    """Its seed is that of the course."""
    world = open_world(_CORRIDOR, _PARTS, None, 7)
    assert isinstance(world, MujocoWorld)
    assert (world.seed, world.vehicle.name) == (7, "car")
    assert world.truth() == {"progress_m": 0.0, "collisions": 0.0}


def test_what_cannot_be_there_is_refused_in_words() -> None:
    """Parts that do not fit, names that nothing bears, and a boat on land."""
    with pytest.raises(ProfileError, match="A tank has no 'steering' or 'wheels'"):
        open_world(Place("corridor", "tank"), _PARTS, None, 1)
    with pytest.raises(UnknownName, match=r"No vehicle matches 'cra'. Did you mean 'car'"):
        open_world(Place("corridor", "cra"), _PARTS, None, 1)
    with pytest.raises(UnknownName, match=r"No world matches 'coridor'. Did you mean 'corridor'"):
        open_world(Place("coridor", "car"), _PARTS, None, 1)
    with pytest.raises(UnknownName, match="No lens matches 'dark'"):
        open_world(Place("corridor", "car", ("dark",)), _PARTS, None, 1)
    with pytest.raises(WorldError, match="A boat floats"):
        open_world(Place("corridor", "boat"), {"propeller", "rudder"}, None, 1)


def test_a_board_takes_its_vehicle_to_a_place(tmp_path: Path) -> None:
    """An operator lays out another course, which the ledger records, and reads the truth."""
    with (
        start_board(CAR, "twin", tmp_path, seed=4, place=_CORRIDOR) as board,
        Operator(board.socket_path) as operator,
    ):
        first = operator.where()
        assert first.truth == {"progress_m": 0.0, "collisions": 0.0}
        operator.lay_out(5)
        other = operator.where()
        assert (other.x, other.y) != (first.x, first.y)
        # What cannot be laid out is said, and the board lives on.
        with pytest.raises(RobotError, match="Seeds of courses count from 0"):
            operator.lay_out(-1)
        operator.lay_out(4)
        again = operator.where()
        assert (again.x, again.y, again.heading) == (first.x, first.y, first.heading)
        laid_out = [one.seed for one in read_ledger(board.ledger_path) if one.kind == "course"]
    assert laid_out == [5, 4]


def test_a_room_is_laid_out_too(tmp_path: Path) -> None:
    """Its boxes stand elsewhere; and it still counts nothing."""
    with start_board(CAR, "twin", tmp_path) as board, Operator(board.socket_path) as operator:
        first = operator.where()
        operator.lay_out(5)
        assert operator.where()[:3] != first[:3]
        assert operator.where().truth == {}


def test_an_operator_who_asks_for_nonsense_breaks_no_board(tmp_path: Path) -> None:
    """A fault or a button that there is not is an answer, and not the end."""
    with (
        start_board(CAR, "twin", tmp_path, CameraPlan("pipe", fps=20.0)) as board,
        Operator(board.socket_path) as operator,
    ):
        with pytest.raises(RobotError, match="No fault of a camera matches 'of'"):
            operator.break_camera("of")  # pyright: ignore[reportArgumentType]  # The nonsense.
        assert operator.advance(0.1) > 0


def test_a_board_that_cannot_be_there_says_why(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The reason is among what it wrote, before it ended."""
    with pytest.raises(RobotError, match="did not start"):
        start_board(CAR, "twin", tmp_path, place=Place("corridor", "tank"))
    assert "A tank has no 'steering' or 'wheels'" in capfd.readouterr().err
