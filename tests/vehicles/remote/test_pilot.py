"""Checks of policies before they drive a robot, and policies that run on board of a twin."""

import contextlib
import os
import signal
import subprocess
from collections.abc import Generator
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace

from shapechanger.cli import main
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.errors import PolicyError, RobotRefused
from shapechanger.policy import PolicyCard
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link.card import RobotCard, card_of
from shapechanger.robot.link.messages import PolicyState, RunPolicy
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from shapechanger.vehicles.envs.demonstrators import CLONES
from shapechanger.vehicles.remote.pilot import require_fit
from shapechanger.vehicles.waypoints import ACTION_LAYOUT
from tests.demos.cloning.data import clone_card
from tests.robot.twin.robots import until

_CAR = replace(
    card_of(load_profile(find_profile("lab-car")), arming="person", clock="real"),
    turning=(1.9, 0.0),
)
_CLONE = clone_card()
_WAYPOINTS = clone_card(ACTION_LAYOUT)


def test_policies_that_fit_are_accepted() -> None:
    """Clones of the same body and rate fit, and policies with waypoints of any body."""
    require_fit(clone_card(body="car", control_hz=20.0), _CAR, measures=False)
    require_fit(_CLONE, _CAR, measures=False)
    require_fit(clone_card(ACTION_LAYOUT, control_hz=20.0), _CAR, measures=False)
    require_fit(_WAYPOINTS, replace(_CAR, turning=None), measures=True)
    within = clone_card(data={"rate_jitter": 0.03}, control_hz=19.61)
    require_fit(within, _CAR, measures=False)
    with pytest.raises(PolicyError, match=r"learned at 19\.61 actions a second, but"):
        require_fit(clone_card(control_hz=19.61), _CAR, measures=False)


@pytest.mark.parametrize(
    ("card", "robot", "text"),
    [
        (clone_card(body="tank"), _CAR, "learned to steer a tank, but lab-car is a car"),
        (clone_card(control_hz=10.0), _CAR, "10 actions a second, but lab-car has control_hz = 20"),
        (_CLONE, replace(_CAR, image_size=None), "lab-car has no camera"),
        (_CLONE, replace(_CAR, action_layout=ACTION_LAYOUT.to_json()), "those required here are"),
        (_WAYPOINTS, replace(_CAR, camera_pitch_deg=None), "pitch_deg and fovy_deg"),
        (_WAYPOINTS, replace(_CAR, turning=None), "turn_deg_per_m or turn_deg_per_s"),
    ],
)
def test_unsuitable_policies_are_refused(card: PolicyCard, robot: RobotCard, text: str) -> None:
    with pytest.raises((PolicyError, RobotRefused)) as refusal:
        require_fit(card, robot, measures=False)
    assert text in str(refusal.value)


@pytest.fixture(scope="module")
def student(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped clone of a car, exported by the command."""
    file = tmp_path_factory.mktemp("policies") / "student.onnx"
    main(["policies", "export", str(CLONES["car"]), "--out", str(file)])
    return file


@pytest.mark.system
@pytest.mark.parametrize(
    ("profile", "name", "text"),
    [
        ("lab-tank", "student.onnx", "learned to steer a car, but lab-tank is a tank"),
        ("lab-car", "studnt.onnx", "student.onnx?"),
        ("lab-car", "student.safetensors", "policies export"),
        ("lab-car", "", "There is no policy NAME.onnx"),
    ],
)
def test_serve_refuses_unsuitable_policies(
    profile: str,
    name: str,
    text: str,
    student: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    path = (student.parent if name.endswith(".onnx") else tmp_path) / name
    (tmp_path / "student.safetensors").touch()
    capsys.readouterr()
    command = ["robot", "serve", profile, "--twin", "--world", "room", "--port", "0"]
    with pytest.raises(SystemExit) as stop:
        main([*command, "--policy", str(path)])
    assert stop.value.code == 2
    assert text in capsys.readouterr().err


@contextlib.contextmanager
def _served(
    policy: Path, clock: Literal["twin", "real"]
) -> Generator[tuple[RunningRobot, RobotClient]]:
    """A twin of lab-car with a policy on board, armed for it by a person who watches."""
    arguments, pace = ("--policy", str(policy)), "lockstep" if clock == "twin" else "realtime"
    with (
        run_robot(find_profile("lab-car"), clock=clock, arguments=arguments) as robot,
        robot.client(role="person", frames=False, pace=pace) as person,
    ):
        until(lambda: person.ask().message.holder == policy.stem)
        # A policy that fails at once releases the robot before the answer.
        with contextlib.suppress(RobotRefused):
            person.arm()
        yield robot, person


def _pilot(robot: RunningRobot) -> int:
    text = ["pgrep", "-P", str(robot.pid_of("daemon")), "-f", "remote.pilot"]
    return int(subprocess.check_output(text).split()[0])


def _moves(person: RobotClient) -> bool:
    return any(person.ask().message.action_applied)


def _policies(person: RobotClient) -> PolicyState:
    return person.answer(PolicyState)


@pytest.mark.gl
@pytest.mark.system
@pytest.mark.realtime
def test_a_policy_drives_on_board(student: Path) -> None:
    """The policy drives from arming until a person takes over; it can be ended and restarted."""
    with _served(student, "twin") as (robot, person), robot.operator() as operator:
        until(lambda: operator.where().truth["progress_m"] > 2.0)
        # Guard, daemon and twin have a higher priority, where the system permits it.
        assert os.getpriority(os.PRIO_PROCESS, _pilot(robot)) >= 0
        assert operator.where().truth["collisions"] == 0.0
        person.take()
        until(lambda: person.ask().message.mine)
        seen = person.ask().message
        person.command([0.0] * 2, answers=seen.seq)
        until(lambda: person.ask().message.suggested_by == "student")
        person._post(RunPolicy(policy=""))
        until(lambda: _policies(person).running == "")
        assert _policies(person).names == ("student",)
        person.release()
        person._post(RunPolicy(policy="student"))
        until(lambda: person.ask().message.holder == "student")
        # The robot stays disarmed until a person arms it again.
        assert not person.ask().message.armed


@pytest.mark.gl
@pytest.mark.system
@pytest.mark.realtime
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_policy_that_dies_or_hangs_stops_the_robot(student: Path, number: int) -> None:
    """The robot stops without any action of a person."""
    killed = "student ended: its process ended with code -9."
    with _served(student, "twin" if number == signal.SIGKILL else "real") as (robot, person):
        until(lambda: _moves(person))
        pid = _pilot(robot)
        os.kill(pid, number)
        until(lambda: not _moves(person))
        if number == signal.SIGKILL:
            until(lambda: person.ask().message.holder == "")
            until(lambda: _policies(person).text == killed)
        else:
            os.kill(pid, signal.SIGCONT)


@pytest.mark.gl
@pytest.mark.system
@pytest.mark.realtime
def test_a_policy_that_returns_nan_is_ended(tmp_path: Path) -> None:
    """The process ends with a message at the first action, and the robot stays at rest."""
    policy = CameraPolicy.blank(_CLONE, seed=0)
    policy.network.hands.bias.data[:] = np.nan
    file = tmp_path / "nan.onnx"
    policy.export(file)
    with _served(file, "twin") as (_, person):
        until(lambda: _policies(person).running == "")
        assert "The policy gave [nan, nan], which is not finite." in _policies(person).text
        until(lambda: person.ask().message.holder == "")
        assert not _moves(person)
