"""The same drives on the twin's clock and, as slow tests, in real time."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from shapechanger.robot.link.messages import Observation
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from shapechanger.robot.twin.signals import read_ledger
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.robots import until
from tests.robots import IN_A_ROOM, write_profile
from tests.served import Clock, Served, driving

pytestmark = [pytest.mark.realtime, pytest.mark.system]

DEADLINE_MS = 250
STALE_MS = 500
TICK_MS = 10.0
LATE_MS = {"twin": TICK_MS, "real": 200.0}
"""Tolerance of a limit: a tick of the guard, or ten times 20 ms on a busy machine."""

DRIVE = (*[(0.0, 1.0)] * 15, *[(1.0, 0.5)] * 10, *[(-1.0, -0.5)] * 10, *[(0.0, 0.0)] * 5)
"""Steering and throttle of 40 commands."""


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> Profile:
    """The car with all sensors."""
    return write_profile(tmp_path_factory.mktemp("profile"))


@pytest.fixture(scope="module", params=["twin", pytest.param("real", marks=pytest.mark.slow)])
def clock(request: pytest.FixtureRequest) -> Clock:
    return request.param


@pytest.fixture(scope="module")
def robot(profile: Profile, clock: Clock) -> Iterator[RunningRobot]:
    """One robot per clock."""
    with run_robot(profile, clock=clock, arguments=IN_A_ROOM) as running:
        yield running


@pytest.fixture
def car(robot: RunningRobot, clock: Clock) -> Iterator[Served]:
    """The armed robot at its start."""
    with driving(robot, clock) as served:
        yield served


@pytest.fixture(scope="module")
def wiring(profile: Profile) -> TwinWiring:
    """Wiring without the one-shot, which would hide late pins."""
    return TwinWiring(profile.guard_plan(), None)


def stands(seen: Observation) -> bool:
    """Return whether the throttle is at rest."""
    return seen.action_applied[1] == 0.0


def drives(seen: Observation) -> bool:
    """Return whether the robot drives forward."""
    return seen.action_applied[1] > 0.0


def test_forty_commands(car: Served, clock: Clock) -> None:
    """Commands are applied in order, and the encoder matches the speed of the wheels."""
    start = car.operator.where()
    times: list[int] = []
    right: list[bool] = []
    for number, values in enumerate(DRIVE, 1):
        seen = car.step(*values)
        assert seen.stop_reason == ""
        assert seen.sources["speed"] == "wheel"
        assert seen.applied_seq in {number, number - 1}
        times.append(seen.sent_ns)
        if 10 <= number <= 15:
            assert seen.action_applied == (0.0, 1.0)
            speed, truth = car.state("speed"), car.operator.where().speed
            right.append(speed > 0.6 and speed == pytest.approx(truth, rel=0.15))
        if number == 35:
            assert seen.action_applied == (-1.0, -0.5)
            assert car.operator.where().travelled_m - start.travelled_m > 0.3
    periods = [after - before for before, after in pairwise(times)]
    # In real time, a busy machine delays the board and its encoder counts.
    assert any(right)
    if clock == "twin":
        assert right[-1]
        assert set(periods) == {50_000_000}
    assert min(periods) > 0


def test_without_commands_the_robot_stops_at_the_deadline(
    car: Served, clock: Clock, wiring: TwinWiring
) -> None:
    """By the ledger, not before the deadline of the last command, and shortly after it."""
    seen = car.drive(0.0, 1.0, steps=6)
    assert seen.command_ns is not None
    went_on_ms = (car.rest_ns(wiring) - seen.command_ns) / 1e6
    assert DEADLINE_MS - TICK_MS <= went_on_ms <= DEADLINE_MS + LATE_MS[clock]


def test_an_emergency_stop_latches(car: Served, clock: Clock) -> None:
    """Arming after having seen the stop clears it."""
    car.drive(0.0, 1.0, steps=3)
    car.client.emergency_stop("a dog")
    took = car.drive_until(lambda seen: seen.emergency and stands(seen), 0.0, 1.0)
    assert took <= (2 if clock == "twin" else 20)
    assert "a dog" in car.seen.stop_reason
    for _ in range(5):
        assert stands(car.step(0.0, 1.0))
    car.client.arm()
    car.seen = car.client.ask().message
    assert not car.seen.emergency
    car.drive_until(drives, 0.0, 1.0)


def test_the_emergency_button_latches(car: Served) -> None:
    """Arming is refused while the button is pressed, and releasing it does not arm."""
    car.drive(0.0, 1.0, steps=3)
    car.operator.press_stop()
    car.drive_until(lambda seen: seen.emergency and stands(seen), 0.0, 1.0)
    assert "button" in car.seen.stop_reason
    car.operator.press_stop(down=False)
    assert stands(car.drive(0.0, 1.0, steps=3))
    car.client.arm()
    car.seen = car.client.ask().message
    car.drive_until(drives, 0.0, 1.0)


def test_the_bumper_prevents_driving_forward_only(car: Served, clock: Clock) -> None:
    """Backward is allowed, and forward once the bumper is free."""
    car.drive(0.0, 1.0, steps=3)
    car.operator.press_bumper()
    took = car.drive_until(stands, 0.0, 1.0)
    assert took <= (2 if clock == "twin" else 20)
    assert "bumper" in car.seen.stop_reason
    assert car.state("collision") == 1.0
    car.drive_until(lambda seen: seen.action_applied[1] == -1.0, 0.0, -1.0)
    car.operator.press_bumper(down=False)
    car.drive_until(drives, 0.0, 1.0)


def test_a_stale_frame_stops_the_robot(car: Served, clock: Clock, wiring: TwinWiring) -> None:
    """The robot stops although commands continue."""
    car.drive(0.0, 0.4, steps=3)
    car.operator.break_camera("off")
    car.drive_until(stands, 0.0, 0.4)
    assert "Blind" in car.seen.stop_reason
    age_ms = (car.rest_ns(wiring) - car.seen.captured_ns) / 1e6
    assert STALE_MS - TICK_MS <= age_ms <= STALE_MS + LATE_MS[clock]
    car.operator.break_camera("")
    car.client.arm()
    car.seen = car.client.ask().message
    car.drive_until(drives, 0.0, 0.4)


def test_a_low_battery_stops_the_robot_until_rearmed(car: Served) -> None:
    """A recovered voltage alone does not clear the stop."""
    car.drive(0.0, 0.4, steps=3)
    car.operator.set_battery(6.0)
    car.drive_until(stands, 0.0, 0.4)
    assert "battery" in car.seen.stop_reason
    car.operator.set_battery(None)
    assert stands(car.drive(0.0, 0.4, steps=15))
    car.client.arm()
    car.seen = car.client.ask().message
    car.drive_until(drives, 0.0, 0.4)


def test_the_distance_ahead(car: Served) -> None:
    """The reported distance is the echo's."""
    car.operator.set_distance(1.2)
    car.drive_until(lambda _: abs(car.state("distance") - 1.2) < 0.02, 0.0, 0.0)
    car.operator.set_distance(None)


def recorded(profile: Profile, seed: int, folder: Path) -> tuple[list[str], list[bytes]]:
    """Return the ledger and the frames of the forty commands."""
    pictures: list[bytes] = []
    with (
        run_robot(profile, clock="twin", seed=seed, folder=folder, arguments=IN_A_ROOM) as robot,
        driving(robot, "twin") as car,
    ):
        for values in DRIVE:
            seen = car.step(*values)
            pictures.append(seen.frame or b"")
        lines = [repr(replace(line, pid=None)) for line in read_ledger(robot.ledger_path)]
    return lines, pictures


def test_the_twins_clock_is_deterministic(profile: Profile, tmp_path: Path) -> None:
    """The same seed gives equal transitions, times and frames."""
    folders = [tmp_path / name for name in ("a", "b", "c")]
    for folder in folders:
        folder.mkdir()
    ledger, pictures = recorded(profile, 3, folders[0])
    again_ledger, again_pictures = recorded(profile, 3, folders[1])
    assert all(pictures)
    assert again_ledger == ledger
    assert again_pictures == pictures
    assert recorded(profile, 4, folders[2])[1] != pictures


def test_a_client_waits_for_a_restarted_daemon(robot: RunningRobot, clock: Clock) -> None:
    """A killed daemon comes back at another port; who connects meanwhile gets that one."""
    before = robot.port
    os.kill(robot.pid_of("daemon"), signal.SIGKILL)
    ready = robot.folder / "ready.json"
    until(lambda: not ready.exists() or str(before) not in ready.read_text())
    with driving(robot, clock) as served:
        served.drive_until(drives, 0.0, 1.0)
    assert robot.port != before
