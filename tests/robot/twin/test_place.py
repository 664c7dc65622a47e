"""Worlds for the vehicle of a twin: the plain room, or a MuJoCo course."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from gpiozero import DigitalOutputDevice

from shapechanger.errors import ProfileError, RobotError, UnknownName, WorldError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.hardware import connect
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.signals import read_ledger
from shapechanger.robot.twin.start import Place, open_world, start_board
from shapechanger.vehicles.twin import course_place
from shapechanger.vehicles.world import MujocoWorld
from tests.robot.twin.robots import CAR

pytestmark = pytest.mark.realtime

_PARTS = {"wheels", "steering"}
_CORRIDOR = course_place("corridor", "car")


def test_the_default_place_is_the_room() -> None:
    """The default place needs no MuJoCo and reports no counters."""
    world = open_world(Place(), _PARTS, None, 1)
    assert isinstance(world, DrivingWorld)
    assert world.picture().shape == (120, 160, 3)
    assert world.truth() == {}


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


def test_a_place_in_mujoco() -> None:
    """The world of a place takes the seed as the seed of its course."""
    world = open_world(_CORRIDOR, _PARTS, None, 7)
    assert isinstance(world, MujocoWorld)
    assert (world.seed, world.vehicle.name) == (7, "car")
    assert world.truth() == {"progress_m": 0.0, "collisions": 0.0}


def test_an_invalid_place_is_refused() -> None:
    """Mismatched parts, unknown names and a boat on land raise errors."""
    with pytest.raises(ProfileError, match="a tank is driven by"):
        open_world(course_place("corridor", "tank"), _PARTS, None, 1)
    with pytest.raises(UnknownName, match=r"No vehicle matches 'cra'. Did you mean 'car'"):
        open_world(course_place("corridor", "cra"), _PARTS, None, 1)
    with pytest.raises(UnknownName, match=r"No world matches 'coridor'. Did you mean 'corridor'"):
        open_world(course_place("coridor", "car"), _PARTS, None, 1)
    with pytest.raises(UnknownName, match="No lens matches 'dark'"):
        open_world(course_place("corridor", "car", ("dark",)), _PARTS, None, 1)
    with pytest.raises(WorldError, match="A boat floats"):
        open_world(course_place("corridor", "boat"), {"propeller", "rudder"}, None, 1)


def test_an_opener_that_does_not_exist_is_refused() -> None:
    with pytest.raises(UnknownName, match=r"'open_cours'. Did you mean 'open_course'"):
        open_world(Place("shapechanger.vehicles.twin:open_cours"), _PARTS, None, 1)
    with pytest.raises(RobotError, match=r"opened by cars.twin:open_course, and there is no cars"):
        open_world(Place("cars.twin:open_course"), _PARTS, None, 1)


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


def test_an_operator_puts_it_back_on_a_course(tmp_path: Path) -> None:
    """The vehicle returns to the lane near the collision, and counters keep their values."""
    plan = load_profile(find_profile("lab-car")).guard_plan()
    with (
        start_board(plan, "twin", tmp_path, place=_CORRIDOR) as board,
        Operator(board.socket_path) as operator,
    ):
        hardware = connect(board.socket_path)
        operator.lay_out(4)
        operator.place(7)
        motor = DigitalOutputDevice(22, initial_value=True, pin_factory=hardware.pin_factory())
        for _ in range(200):
            operator.advance(0.05)
            if operator.where().truth["collisions"]:
                break
        hit = operator.where()
        assert hit.truth["collisions"] == 1.0
        operator.put_back()
        back = operator.where()
        assert back.speed == 0.0
        assert not back.bumped
        assert 0.0 < (back.x - hit.x) ** 2 + (back.y - hit.y) ** 2 < 1.5**2
        assert back.truth["collisions"] == 1.0
        assert back.truth["progress_m"] == pytest.approx(hit.truth["progress_m"], abs=1.5)
        assert back.distance_m > hit.distance_m
        motor.close()
        hardware.close()
    kinds = [line.kind for line in read_ledger(board.ledger_path)]
    assert [kind for kind in kinds if kind in ("course", "place", "put_back")] == [
        "course",
        "place",
        "put_back",
    ]


def test_an_invalid_operator_request_keeps_the_board_running(tmp_path: Path) -> None:
    with (
        start_board(CAR, "twin", tmp_path, CameraPlan("pipe", fps=20.0)) as board,
        Operator(board.socket_path) as operator,
    ):
        with pytest.raises(RobotError, match="No fault of a camera matches 'of'"):
            operator.break_camera("of")  # pyright: ignore[reportArgumentType]  # Invalid on purpose.
        assert operator.advance(0.1) > 0


def test_a_board_that_fails_to_start_prints_the_reason(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(RobotError, match="did not start"):
        start_board(CAR, "twin", tmp_path, place=course_place("corridor", "tank"))
    assert "a tank is driven by" in capfd.readouterr().err
