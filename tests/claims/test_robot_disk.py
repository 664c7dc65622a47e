"""A full disk costs the robot its log, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.robot.twin.robot import run_robot
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robots import IN_A_ROOM, write_profile
from tests.served import driving

pytestmark = [pytest.mark.realtime, pytest.mark.system]


def test_a_full_disk(tmp_path: Path) -> None:
    """The robot serves, drives and stops at its deadline without a log."""
    profile = write_profile(tmp_path)
    with (
        Path("/dev/full").open("wb") as full,
        run_robot(profile, log=full, arguments=IN_A_ROOM) as robot,
        driving(robot, "real") as car,
    ):
        car.drive_until(lambda seen: seen.action_applied[1] == 1.0, 0.0, 1.0)
        command_ns = car.seen.command_ns
        assert command_ns is not None
        rest_ns = car.rest_ns(TwinWiring(profile.guard_plan(), None))
        assert (rest_ns - command_ns) / 1e6 <= 250 + 200
        car.client.arm()  # It still responds.
        assert robot.supervisor.poll() is None
