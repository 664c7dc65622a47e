"""Drives on the twin's clock repeat exactly, and clients wait for a killed daemon."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.ledger import TwinWiring, read_ledger
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.robot.twin.robots import until
from tests.robots import IN_A_ROOM, write_profile
from tests.served import driving

pytestmark = [pytest.mark.realtime, pytest.mark.system]

DEADLINE_MS = 250
TICK_MS = 10.0

DRIVE = (*[(0.0, 1.0)] * 15, *[(1.0, 0.5)] * 10, *[(-1.0, -0.5)] * 10, *[(0.0, 0.0)] * 5)
"""Steering and throttle of 40 commands."""


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> Profile:
    return write_profile(tmp_path_factory.mktemp("profile"))


@pytest.fixture(scope="module")
def robot(profile: Profile) -> Iterator[RunningRobot]:
    with run_robot(profile, clock="twin", arguments=IN_A_ROOM) as running:
        yield running


def test_forty_commands_are_applied(robot: RunningRobot) -> None:
    """Commands are applied in order, and the encoder matches the speed of the wheels."""
    times: list[int] = []
    with driving(robot, "twin") as car:
        start = car.operator.where()
        for number, values in enumerate(DRIVE, 1):
            seen = car.step(*values)
            assert seen.stop_reason == ""
            assert seen.sources["speed"] == "wheel"
            assert seen.applied_seq in {number, number - 1}
            times.append(seen.sent_ns)
            if number == 15:
                assert seen.action_applied == (0.0, 1.0)
                assert car.state("speed") > 0.6
                assert car.state("speed") == pytest.approx(car.operator.where().speed, rel=0.15)
            if number == 35:
                assert seen.action_applied == (-1.0, -0.5)
                assert car.operator.where().travelled_m - start.travelled_m > 0.3
    assert {after - before for before, after in pairwise(times)} == {50_000_000}


def test_without_commands_the_robot_stops_at_the_deadline(
    robot: RunningRobot, profile: Profile
) -> None:
    """The ledger shows rest within a tick of the deadline of the last command."""
    # The one-shot would hide late pins, so only the pins are judged.
    wiring = TwinWiring(profile.guard_plan(), None)
    with driving(robot, "twin") as car:
        seen = car.drive(0.0, 1.0, steps=6)
        assert seen.command_ns is not None
        went_on_ms = (car.rest_ns(wiring) - seen.command_ns) / 1e6
    assert DEADLINE_MS - TICK_MS <= went_on_ms <= DEADLINE_MS + TICK_MS


def recorded(profile: Profile, seed: int, folder: Path) -> tuple[list[str], list[bytes]]:
    """Return the ledger and the frames of the forty commands."""
    folder.mkdir()
    with (
        run_robot(profile, clock="twin", seed=seed, folder=folder, arguments=IN_A_ROOM) as robot,
        driving(robot, "twin") as car,
    ):
        pictures = [car.step(*values).frame or b"" for values in DRIVE]
        lines = [repr(replace(line, pid=None)) for line in read_ledger(robot.ledger_path)]
    return lines, pictures


def test_the_twins_clock_is_deterministic(profile: Profile, tmp_path: Path) -> None:
    """The same seed gives equal transitions, times and frames."""
    ledger, pictures = recorded(profile, 3, tmp_path / "a")
    assert all(pictures)
    assert recorded(profile, 3, tmp_path / "b") == (ledger, pictures)
    assert recorded(profile, 4, tmp_path / "c")[1] != pictures


def test_a_client_waits_for_a_restarted_daemon(robot: RunningRobot) -> None:
    """A killed daemon restarts at another port, and a client that waits connects there."""
    before = robot.port
    os.kill(robot.pid_of("daemon"), signal.SIGKILL)
    ready = robot.folder / "ready.json"
    until(lambda: not ready.exists() or str(before) not in ready.read_text())
    with driving(robot, "twin") as served:
        served.drive_until(lambda seen: seen.action_applied[1] > 0.0, 0.0, 1.0)
    assert robot.port != before
