"""Serving a twin registers it, and any observer can stop it."""

from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import recall, remember
from shapechanger.robot.twin.robot import run_robot
from tests.cli.robot.typing import Person
from tests.robots import BLIND_CAR, IN_A_ROOM, write_profile
from tests.served import driving

pytestmark = [pytest.mark.realtime, pytest.mark.system]


def test_a_second_person_stops_a_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`robot stop` works while another client drives, and stays in force."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with run_robot(write_profile(tmp_path, BLIND_CAR), arguments=IN_A_ROOM) as robot:
        remember(replace(robot.known, name="car"))
        with driving(robot, "real") as car:
            car.drive_until(lambda seen: seen.action_applied[1] > 0.0, 0.0, 0.5)
            main(["robot", "stop", "car", "--reason", "a dog"])
            output = capsys.readouterr().out
            assert output.startswith("car is stopped. ")
            assert "a dog" in output
            assert "shapechanger robot drive car" in output
            seen = car.step(0.0, 0.5)
            assert seen.emergency
            assert seen.action_applied[1] == 0.0


def test_a_name_is_that_of_a_robot_that_can_be_reached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of any free port, the real one is stored; a robot that does not start keeps no name."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    profile = write_profile(tmp_path, BLIND_CAR)
    serve = ("robot", "serve", str(profile.path), "--twin", "--no-announce", "--port", "0")
    serve += (*IN_A_ROOM, "--twin-folder", str(tmp_path))
    with Person(serve, tmp_path) as person:
        person.read_until("Known here as blind-car: `shapechanger robot drive blind-car`")
        known = recall("blind-car")
        with RobotClient.connect(known, frames=False) as client:
            assert client.welcome.robot == "blind-car"
        with Person(serve, tmp_path) as second:
            assert second.end() != 0, second.text
        assert recall("blind-car") == known
        person.process.terminate()
        assert person.end() == 0
