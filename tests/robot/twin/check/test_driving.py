"""Checks that drive a robot; the robot runs on a twin."""

from pathlib import Path

import pytest

from shapechanger.robot.check.report import Finding
from shapechanger.robot.twin.check.driving import check_driving
from shapechanger.robot.twin.robot import run_robot
from tests.robots import BLIND_CAR, CAR, IN_A_ROOM, changed, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]


def _checked(folder: Path, text: str, wired: str = "") -> dict[str, Finding]:
    profile = write_profile(folder, text)
    (folder / "robot").mkdir()
    arguments: tuple[str, ...] = IN_A_ROOM
    if wired:
        (folder / "true").mkdir()
        arguments = ("--wired-as", str(write_profile(folder / "true", wired).path), *IN_A_ROOM)
    with run_robot(profile, folder=folder / "robot", arguments=arguments) as robot:
        return {check.check: check for check in check_driving(robot, profile, 0.5)}


def test_an_encoder_that_counts_backward_is_found(tmp_path: Path) -> None:
    """With swapped encoder pins, only the check "drives" is bad."""
    swapped = changed("a = 5\nb = 6\n", "a = 6\nb = 5\n")
    checks = _checked(tmp_path, swapped, wired=CAR)
    assert [name for name, check in checks.items() if check.level != "good"] == ["drives"]
    assert checks["drives"].level == "bad"
    assert {"boots disarmed", "stops by silence", "emergency stop"} <= set(checks)
    assert "disarmed after a crash" in checks


def test_without_an_encoder_checks_are_unknown(tmp_path: Path) -> None:
    """Without an encoder, checks of the wheels are "unknown"; stops are measured at the outputs."""
    checks = _checked(tmp_path, BLIND_CAR)
    assert (checks["drives"].level, checks["wheels stand"].level) == ("unknown", "unknown")
    # The time is not checked, because the test machine may be busy.
    assert checks["stops by silence"].level != "unknown"
