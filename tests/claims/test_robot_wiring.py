"""Swapped pins in a profile drive the wrong motor of the twin."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.robot.twin.operator import Whereabouts
from shapechanger.robot.twin.robot import run_robot
from tests.robots import CAR, IN_A_ROOM, SWAPPED_ROLES, SWAPPED_WAYS, write_profile
from tests.served import driving

pytestmark = [pytest.mark.realtime, pytest.mark.system]


def driven(folder: Path, text: str) -> tuple[Whereabouts, Whereabouts, float]:
    """Return a car's place before and after full throttle, and the speed by its encoder.

    Args:
        folder: An empty folder.
        text: The profile served; the wiring is the correct profile's.
    """
    (folder / "wired").mkdir()
    wired = write_profile(folder / "wired")
    served = write_profile(folder, text)
    arguments = ("--wired-as", str(wired.path), *IN_A_ROOM)
    with (
        run_robot(served, clock="twin", arguments=arguments) as robot,
        driving(robot, "twin") as car,
    ):
        before = car.operator.where()
        car.drive(0.0, 1.0, steps=8)
        return before, car.operator.where(), car.state("speed")


def test_the_correct_profile_drives_forward(tmp_path: Path) -> None:
    """Position and encoder agree."""
    before, after, speed = driven(tmp_path, CAR)
    assert after.travelled_m - before.travelled_m > 0.1
    assert speed > 0.3


def test_forward_and_backward_swapped(tmp_path: Path) -> None:
    """The car drives backward, and the encoder shows it."""
    before, after, speed = driven(tmp_path, SWAPPED_WAYS)
    assert after.travelled_m - before.travelled_m < -0.1
    assert speed < -0.3


def test_drive_and_steering_swapped(tmp_path: Path) -> None:
    """The car steers without moving."""
    before, after, speed = driven(tmp_path, SWAPPED_ROLES)
    assert after.travelled_m == pytest.approx(before.travelled_m, abs=0.01)
    assert speed == pytest.approx(0.0, abs=0.01)
