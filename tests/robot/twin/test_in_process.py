"""A robot's guard, drivers and pins in one process: slew, wiring and bumps."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.twin.room import DrivingWorld
from tests.robot.twin.in_process import InProcessRobot
from tests.robots import CAR, SWAPPED_WAYS, changed, write_profile

_PARTS = {"wheels", "steering"}


def _room() -> DrivingWorld:
    return DrivingWorld(_PARTS, (160, 120), seed=1)


def test_swapped_pins_drive_backward(tmp_path: Path) -> None:
    """The pins of the profile drive the world: swapping them reverses the motion."""
    travelled: list[float] = []
    for text in (CAR, SWAPPED_WAYS):
        # Swap the pins of the driver only, not those of the wiring.
        world = _room()
        profile = write_profile(tmp_path, text)
        robot = InProcessRobot(
            profile, world, pictures=False, wired_as=write_profile(tmp_path, CAR).guard_plan()
        )
        robot.start(lambda world=world: world.place(2))
        for _ in range(10):
            robot.step((0.0, 1.0))
        travelled.append(world.inputs().travelled_m)
        robot.close()
    assert travelled[0] > 0.1
    assert travelled[1] == pytest.approx(-travelled[0], rel=0.05)


def test_a_sensor_that_is_not_wired_is_refused(tmp_path: Path) -> None:
    """An unwired sensor raises the guard's error at construction."""
    unwired = changed('[sensor.pack]\ndriver = "ina219"\n', "")
    attached = write_profile(tmp_path, unwired.replace("low_battery_v = 6.6\n", "")).guard_plan()
    profile = write_profile(tmp_path, CAR)
    with pytest.raises(RobotError, match=r"Sensor 'pack' .* does not answer"):
        InProcessRobot(profile, _room(), pictures=False, wired_as=attached)
