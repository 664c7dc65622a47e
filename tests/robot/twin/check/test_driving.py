"""Checks that drive a robot; the robot runs on a twin."""

from pathlib import Path

import pytest

from shapechanger.robot.twin.check.driving import check_driving
from shapechanger.robot.twin.robot import run_robot
from tests.robots import CAR, IN_A_ROOM, changed, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]


def test_an_encoder_that_counts_backward_is_found(tmp_path: Path) -> None:
    """With swapped encoder pins, only the check "drives" is bad."""
    profile = write_profile(tmp_path, changed("a = 5\nb = 6\n", "a = 6\nb = 5\n"))
    for name in ("robot", "true"):
        (tmp_path / name).mkdir()
    arguments = ("--wired-as", str(write_profile(tmp_path / "true", CAR).path), *IN_A_ROOM)
    with run_robot(profile, folder=tmp_path / "robot", arguments=arguments) as robot:
        checks = {check.check: check for check in check_driving(robot, profile, 0.5)}
    assert [name for name, check in checks.items() if check.level != "good"] == ["drives"]
    assert checks["drives"].level == "bad"
    assert {"boots disarmed", "stops by silence", "emergency stop"} <= set(checks)
    assert "disarmed after a crash" in checks
