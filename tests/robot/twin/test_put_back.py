"""Operators can put back a vehicle that has collided."""

from __future__ import annotations

from pathlib import Path

import pytest
from gpiozero import DigitalOutputDevice

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.hardware import connect
from shapechanger.robot.twin.operator import Operator
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.signals import read_ledger
from shapechanger.robot.twin.start import start_board
from shapechanger.vehicles.twin import course_place

pytestmark = pytest.mark.realtime

_CORRIDOR = course_place("corridor", "car")


def _lab_car() -> GuardPlan:
    return load_profile(find_profile("lab-car")).guard_plan()


def test_put_back_in_a_room_restores_the_start_pose() -> None:
    """The vehicle stands still at its start, and its odometer keeps its value."""
    world = DrivingWorld({"wheels", "steering"}, (8, 6), seed=2)
    world.place(5)
    start = world.inputs().pose
    for _ in range(600):
        world.advance(0.01, {"wheels": 1.0})
    assert world.inputs().bumped
    travelled_m = world.inputs().travelled_m
    world.put_back()
    assert world.inputs().pose == start
    assert not world.inputs().bumped
    assert world.inputs().speed == 0.0
    assert world.inputs().travelled_m == travelled_m


def test_an_operator_puts_it_back_on_a_course(tmp_path: Path) -> None:
    """The vehicle returns to the lane near the collision, and counters keep their values."""
    with (
        start_board(_lab_car(), "twin", tmp_path, place=_CORRIDOR) as board,
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
