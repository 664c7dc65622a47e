"""`shapechanger demos replay --robot` on a twin, with a person at the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.layout import Layout
from shapechanger.robot.client.known_robots import KnownRobot, remember
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.cli.robot.typing import Person
from tests.robot.client.robot import eventually
from tests.robots import IN_A_ROOM, PATIENT_CAR, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RunningRobot]:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot:
        known = robot.known
        remember(KnownRobot("car", known.address, known.key, known.fingerprint))
        yield robot


def forward(folder: Path, robot: RunningRobot, seconds: float, **changes: object) -> Path:
    """Record an episode of this robot: full throttle for some seconds, then rest."""
    with robot.client(role="person") as client:
        welcome = client.welcome
    about = EpisodeHeader(
        action_layout=Layout.from_json(welcome.action_layout),
        control_hz=welcome.control_hz,
        robot="car",
    )
    about = replace(about, **changes)
    with EpisodeWriter.create(folder / "data", about, spare_bytes=0) as writer:
        for _ in range(round(seconds * welcome.control_hz)):
            writer.add(Step(action=(0.0, 1.0), driver="person"))
        for _ in range(4):
            writer.add(Step(action=(0.0, 0.0), driver="person"))
    return writer.path


def person(episode: Path, folder: Path) -> Person:
    arguments = ("demos", "replay", str(episode), "--robot", "car")
    return Person(arguments, folder, {"XDG_CONFIG_HOME": str(folder)})


def test_an_episode_plays_after_arming(robot: RunningRobot, tmp_path: Path) -> None:
    """The robot does not move before E; at the end it is at rest and disarmed."""
    episode = forward(tmp_path, robot, 0.6)
    with robot.operator() as operator, person(episode, tmp_path) as terminal:
        operator.place(0)
        start = operator.where().travelled_m
        terminal.read_until("E arms it")
        assert operator.where().travelled_m == start
        terminal.press("e")
        terminal.read_until("played 16 steps")
        assert terminal.end() == 0
        assert operator.where().travelled_m - start > 0.05
        eventually(lambda: operator.where().speed < 0.05, 20.0)
        with robot.client(role="person") as client:
            assert not client.ask().message.armed


def test_any_key_stops_the_robot(robot: RunningRobot, tmp_path: Path) -> None:
    """A key sends an emergency stop, which only a person can clear."""
    episode = forward(tmp_path, robot, 60.0)
    with robot.operator() as operator, person(episode, tmp_path) as terminal:
        operator.place(0)
        start = operator.where().travelled_m
        terminal.read_until("E arms it")
        terminal.press("e")
        terminal.wait_for(lambda: operator.where().travelled_m - start > 0.05)
        terminal.press("j")
        terminal.read_until("stopped by a key")
        assert terminal.end() == 0
        eventually(lambda: operator.where().speed < 0.05, 20.0)
        with robot.client(role="person") as client:
            assert client.ask().message.emergency


def test_any_key_except_e_ends_the_replay(robot: RunningRobot, tmp_path: Path) -> None:
    """E after another key does not arm, so that a hand resting on the keys is safe."""
    episode = forward(tmp_path, robot, 0.2)
    with robot.operator() as operator, person(episode, tmp_path) as terminal:
        operator.place(0)
        start = operator.where().travelled_m
        terminal.read_until("E arms it")
        terminal.press("qe")
        terminal.read_until("no step was played")
        assert terminal.end() == 0
        assert operator.where().travelled_m == start


def test_an_episode_that_does_not_fit_the_robot_is_refused(
    robot: RunningRobot, tmp_path: Path
) -> None:
    slow = forward(tmp_path / "slow", robot, 0.2, control_hz=7.0)
    with person(slow, tmp_path) as terminal:
        terminal.read_until("steps a second.")
        assert terminal.end() == 2
    with robot.client(role="person") as client:
        layout = client.welcome.action_layout.replace('"low":-1.0', '"low":-0.5', 1)
    other = forward(tmp_path / "other", robot, 0.2, action_layout=Layout.from_json(layout))
    with person(other, tmp_path) as terminal:
        terminal.read_until("was recorded with steering [1] from -0.5 to 1")
        assert terminal.end() == 2
