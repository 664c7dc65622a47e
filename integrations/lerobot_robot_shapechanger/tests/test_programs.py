"""LeRobot's own programs with a robot on its twin and a person at its console."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.scripts.lerobot_record import DatasetRecordConfig, RecordConfig, record
from lerobot.scripts.lerobot_teleoperate import TeleoperateConfig, teleoperate

from lerobot_robot_shapechanger import ShapechangerConfig, ShapechangerConsoleConfig
from shapechanger.errors import LinkError
from shapechanger.robot.twin.robot import RunningRobot

from .conftest import served
from .stick import Stick, StickConfig

AHEAD = (-1.0, 0.3)  # Steering and throttle of a circle to the left.
PROGRAMS = Path(sys.executable).parent


@pytest.fixture
def at_the_wheel(person: Any) -> Any:
    """A person who takes control as soon as LeRobot has it, and drives."""
    person.drive(AHEAD)
    return person


def arguments(robot: str = "lab-car") -> list[str]:
    """Return the arguments that both programs take."""
    return [
        "--robot.type=shapechanger",
        f"--robot.id={robot}",
        "--teleop.type=shapechanger",
        "--teleop.id=lab-car",
    ]


def run(program: str, *more: str) -> subprocess.CompletedProcess[str]:
    """Run a program of LeRobot to its end."""
    command = [str(PROGRAMS / program), *more]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_another_teleoperator_drives_the_robot(robot: RunningRobot, until: Any) -> None:
    """`lerobot-teleoperate` moves the robot, and stops it at the end."""
    teleoperate(
        TeleoperateConfig(
            teleop=StickConfig(),
            robot=ShapechangerConfig(id="lab-car"),
            fps=20,
            teleop_time_s=1.0,
        )
    )
    with robot.operator() as operator, robot.client(role="person") as person:
        assert operator.where().travelled_m > 0.05
        until(lambda: not person.ask().message.armed)
        until(lambda: not person.ask().message.holder)


def test_a_person_drives_within_lerobot(robot: RunningRobot, at_the_wheel: Any) -> None:
    """LeRobot sends back the person's own commands, and the robot follows the person."""
    teleoperate(
        TeleoperateConfig(
            teleop=ShapechangerConsoleConfig(id="lab-car"),
            robot=ShapechangerConfig(id="lab-car"),
            fps=20,
            teleop_time_s=1.0,
        )
    )
    suggested = [seen for seen in at_the_wheel.seen if seen.suggested]
    assert suggested[-1].suggested == pytest.approx(AHEAD)
    assert suggested[-1].suggested_by == "lerobot"
    at_the_wheel.let_go()
    assert at_the_wheel.client.ask().message.mine  # The person still has control.
    assert all(seen.mine for seen in at_the_wheel.seen)


def test_a_dataset_has_what_the_person_did(
    robot: RunningRobot, at_the_wheel: Any, tmp_path: Path
) -> None:
    """`lerobot-record` makes two episodes, which `LeRobotDataset` reads back."""
    folder = tmp_path / "drive"
    done = run(
        "lerobot-record",
        *arguments(),
        "--dataset.repo_id=tests/drive",
        f"--dataset.root={folder}",
        "--dataset.single_task=Drive through the room.",
        "--dataset.fps=20",
        "--dataset.num_episodes=2",
        "--dataset.episode_time_s=2",
        "--dataset.reset_time_s=0.5",
        "--dataset.vcodec=h264",
        "--dataset.push_to_hub=false",
        "--play_sounds=false",
    )
    assert done.returncode == 0, done.stderr
    data = LeRobotDataset("tests/drive", root=folder, video_backend="pyav")
    assert data.num_episodes == 2
    assert data.fps == 20
    assert data.meta.robot_type == "shapechanger"
    assert data.features["action"]["names"] == ["steering", "throttle"]
    assert tuple(data.features["observation.images.camera"]["shape"]) == (120, 160, 3)
    frames = [data[i] for i in range(len(data))]
    assert {int(frame["episode_index"]) for frame in frames} == {0, 1}
    assert {frame["task"] for frame in frames} == {"Drive through the room."}
    actions = np.array([frame["action"].numpy() for frame in frames])
    # If the person's thread is late, the robot rests for a moment.
    driven = np.isclose(actions, AHEAD).all(axis=1)
    assert np.mean(driven) > 0.5
    assert (actions[~driven] == 0.0).all()
    states = np.array([frame["observation.state"].numpy() for frame in frames])
    assert np.isfinite(states).all()
    names = data.features["observation.state"]["names"]
    assert names[-2:] == ["steering/applied", "throttle/applied"]
    assert states[:, names.index("throttle/applied")].max() > 0.0
    pictures = np.array([frame["observation.images.camera"].numpy() for frame in frames])
    assert pictures.shape[1:] == (3, 120, 160)
    assert pictures.std() > 0.01
    stats = data.meta.stats["observation.state"]
    assert all(np.isfinite(value).all() for value in stats.values())


def test_a_wrong_name_shows_the_nearest(robot: RunningRobot) -> None:
    """`lerobot-teleoperate` finds our package by its name, and its last line is the error."""
    done = run("lerobot-teleoperate", *arguments("lab-cra"))
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "shapechanger.errors.UnknownName: No known robot matches 'lab-cra'. Did you mean "
        "'lab-car'? There are: lab-car. `shapechanger robot serve PROFILE --twin` serves a twin "
        "and makes it known."
    )


def test_an_unplugged_robot_ends_teleoperation(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot whose processes are killed ends LeRobot's loop with a sentence."""
    config = TeleoperateConfig(teleop=StickConfig(), robot=ShapechangerConfig(id="lab-car"), fps=20)
    with served() as robot:
        _kill_at_action(20, robot, monkeypatch)
        with pytest.raises(LinkError) as lost:
            teleoperate(config)
    _assert_is_a_sentence(lost.value)


def test_an_unplugged_robot_costs_one_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A dataset has the episodes that were completed before the robot was unplugged."""
    dataset = DatasetRecordConfig(
        repo_id="tests/drive",
        single_task="Drive ahead.",
        root=tmp_path / "drive",
        fps=20,
        episode_time_s=1.0,
        reset_time_s=0.0,
        num_episodes=3,
        push_to_hub=False,
        vcodec="h264",
    )
    config = RecordConfig(
        teleop=StickConfig(),
        robot=ShapechangerConfig(id="lab-car"),
        dataset=dataset,
        play_sounds=False,
    )
    with served() as robot:
        _kill_at_action(25, robot, monkeypatch)  # In the second episode: one has 20 at most.
        with pytest.raises(LinkError) as lost:
            record(config)
    _assert_is_a_sentence(lost.value)
    data = LeRobotDataset("tests/drive", root=tmp_path / "drive", video_backend="pyav")
    assert 1 <= data.num_episodes <= 2
    assert data[len(data) - 1]["observation.images.camera"].shape == (3, 120, 160)


def _kill_at_action(number: int, robot: RunningRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kill the daemon, and the supervisor that would start it again, at an action of the stick."""
    ahead, numbers = Stick.get_action, itertools.count(1)

    def get_action(stick: Stick) -> dict[str, float]:
        if next(numbers) == number:
            daemon = robot.pid_of("daemon")
            robot.supervisor.kill()
            os.kill(daemon, signal.SIGKILL)
        return ahead(stick)

    monkeypatch.setattr(Stick, "get_action", get_action)


def _assert_is_a_sentence(lost: LinkError) -> None:
    assert str(lost).startswith("The link to the robot is lost")
    assert len(str(lost).splitlines()) == 1
