"""Driving and calibrating a twin from a terminal."""

import sys
import tomllib
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shapechanger.cli import main
from shapechanger.cli.robot.drive import recorded_to
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.client.known_robots import recall, remember
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.twin.robot import Operator, RunningRobot, run_robot
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.cli.robot.typing import Person
from tests.robot.client.robot import eventually
from tests.robots import BLIND_CAR, IN_A_ROOM, PATIENT_CAR, changed, write_profile
from tests.served import driving

pytestmark = [pytest.mark.realtime, pytest.mark.system]

CAR = """\
[robot]
name = "small-car"
body = "car"
"""
SERVO = """
[action.steering]
gain = 1.0  # Not touched.

[output.steer]
driver = "servo"
part = "steering"
over = "lgpio"
pin = 18
left_us = 1150   # Full left.
centre_us = 1500
right_us = 1850
mix = { steering = 1.0 }
"""
MOTOR = """
[action.throttle]
propels = true

[output.drive]
driver = "hbridge"
part = "wheels"
forward = 22  # Header place 15.
backward = 27
mix = { throttle = 0.8 }
"""
ESC = """
[action.throttle]
propels = true

[output.drive]
driver = "esc"
part = "wheels"
over = "lgpio"
pin = 18
backward_us = 1100
neutral_us = 1500
forward_us = 1900
mix = { throttle = 1.0 }
"""

# A car with a blade, which is up at rest, and which no key moves.
PLOUGH = changed(
    "[output.drive]",
    """[action.blade]
one_sided = true
rest = 1.0

[output.blade]
driver = "servo"
over = "lgpio"
pin = 18
mix = { blade = 1.0 }

[output.drive]""",
    PATIENT_CAR,
)


@contextmanager
def _at_the_terminal(
    folder: Path, cap: str, text: str = PATIENT_CAR
) -> Generator[tuple[RunningRobot, Operator, Person]]:
    """Drive a served car from a terminal, with `folder` as the home; Q ends the command."""
    with (
        pytest.MonkeyPatch.context() as patch,
        run_robot(write_profile(folder, text), arguments=IN_A_ROOM) as robot,
        robot.operator() as operator,
    ):
        patch.setenv("XDG_CONFIG_HOME", str(folder))
        remember(replace(robot.known, name="car"))
        operator.place(0)
        with Person(("robot", "drive", "car", "--cap", cap), folder) as person:
            yield robot, operator, person

            def leaves() -> bool:
                person.press("q")  # Directly after Escape, Q would be part of an escape sequence.
                return person.process.poll() is not None

            person.wait_for(leaves)
            assert person.end() == 0


def test_driving(tmp_path: Path) -> None:
    """E arms, W drives, X disarms, Space and Escape stop, and Q ends the command."""
    with _at_the_terminal(tmp_path, "1.0") as (_, operator, person):
        start = operator.where().travelled_m
        person.read_until("not armed")
        person.press("e")
        read = person.read_until("\rarmed · cap 1.0")
        person.press("w")
        person.wait_for(lambda: operator.where().travelled_m - start > 0.1)
        # Without key repeats, driving stops.
        person.wait_for(lambda: operator.where().speed < 0.05)
        person.press("x")
        read = person.read_until("not armed", read)
        for stop in (" ", "\x1b"):
            person.press("e")
            read = person.read_until("\rarmed · cap 1.0", read)
            person.press(stop)
            read = person.read_until("EMERGENCY STOP", read)


def test_actions_without_a_key_stay_at_rest(tmp_path: Path) -> None:
    with (
        _at_the_terminal(tmp_path, "0.5", PLOUGH) as (robot, operator, person),
        robot.client(frames=False) as watcher,
    ):
        start = operator.where().travelled_m
        person.read_until("not armed")
        person.press("e")
        person.read_until("\rarmed · cap 0.5")
        person.press("w")
        person.wait_for(lambda: operator.where().travelled_m - start > 0.1)
        assert watcher.ask().message.action_applied[2] == pytest.approx(1.0)


def test_a_cap_below_a_threshold_is_reported(tmp_path: Path) -> None:
    """Three-level steering has no effect below its threshold, and a hint is shown."""
    with _at_the_terminal(tmp_path, "0.2") as (_, _, person):
        person.read_until("not armed")
        person.press("e")
        person.read_until("\rarmed · cap 0.2")

        def holds_d() -> bool:
            person.press("d")
            return "a steering of 0.2 moves nothing here" in person.text

        person.wait_for(holds_d)


def test_a_person_lets_a_waiting_program_drive(tmp_path: Path) -> None:
    """P gives the armed robot to the program, and the person can still stop it."""
    with _at_the_terminal(tmp_path, "0.5") as (_, _, person):
        read = person.read_until("not armed")
        person.press("p")
        read = person.read_until("no program waits", read)
        person.press("e")
        read = person.read_until("\rarmed · cap 0.5", read)
        waits: list[str] = []

        def on_waiting(sentence: str) -> None:
            waits.append(sentence)
            person.press("p")

        env = RemoteVehicleEnv("car", on_waiting=on_waiting, name="ada")
        env.reset()
        person.read_until("armed, commanded by ada", read)
        *_, truncated, info = env.step(np.array([0.0, 0.3], np.float32))
        assert not truncated, info["truncated_because"]
        person.press(" ")
        while not truncated:
            *_, truncated, info = env.step(np.array([0.0, 0.3], np.float32))
        assert info["truncated_because"].startswith("Emergency stop")
        assert "has control" in waits[0]
        env.close()


@pytest.mark.skipif(sys.platform != "linux", reason="Needs the parent-death signal.")
def test_killing_the_command_ends_its_robot(tmp_path: Path) -> None:
    """An armed robot must not keep running after its terminal was closed."""
    profile = write_profile(tmp_path, CAR + MOTOR)
    with Person(("robot", "calibrate", str(profile.path), "--twin"), tmp_path) as person:
        person.read_until("begins to move")
        # The supervisor, and its child processes guard and daemon.
        person.wait_for(lambda: len(_below(person.process.pid)) >= 3)
        robot = _below(person.process.pid)
        person.process.kill()
        person.process.wait(20.0)
    eventually(lambda: not any(Path(f"/proc/{pid}").exists() for pid in robot))


def _below(pid: int) -> list[int]:
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except FileNotFoundError:
        return []
    return [one for child in map(int, children) for one in (child, *_below(child))]


def _calibrate(folder: Path, text: str, *steps: tuple[str, str], code: int = 0) -> tuple[str, str]:
    """Calibrate with keys after each prompt; return the output, and the profile afterwards."""
    profile = write_profile(folder, text)
    with Person(("robot", "calibrate", str(profile.path), "--twin"), folder) as person:
        read = 0
        for prompt, keys in steps:
            read = person.read_until(prompt, read)
            person.press(keys)
        assert person.end() == code, person.text
        return person.text, profile.path.read_text()


def test_calibrating_a_motor_and_a_servo(tmp_path: Path) -> None:
    steps = (
        ("begins to move", "d" * 4 + "\r"),
        ("Y or N", "n"),
        ("full left", "a" * 25 + "\r"),  # 25 steps from 1500 us to the left, each 2 % of 900 us.
        ("straight", "d\r"),
        ("full right", "d" * 20 + "\r"),
    )
    _, text = _calibrate(tmp_path, CAR + MOTOR + SERVO, *steps)
    outputs = tomllib.loads(text)["output"]
    drive, steer = outputs["drive"], outputs["steer"]
    assert drive["start"] == pytest.approx(4 * 0.05 * 0.8)
    assert drive["mix"] == {"throttle": -0.8}
    assert steer["left_us"] == pytest.approx(1500 - 0.5 * 900)
    assert steer["centre_us"] == pytest.approx(1500 + 0.02 * 900)
    assert steer["right_us"] == pytest.approx(1500 + 0.4 * 900)
    for kept in ("# Header place 15.", "# Full left.", "# Not touched.", "calibrated = "):
        assert kept in text


def test_an_esc_exceeds_the_cap_only_after_a_confirmation(tmp_path: Path) -> None:
    steps = (
        ("fastest backward", "a" * 40),
        ("Go beyond it?", "\r"),
        ("surely at rest", "\r"),
        ("fastest forward", "d" * 40),
        ("Go beyond it?", "y" + "d" * 5 + "\r"),
    )
    _, text = _calibrate(tmp_path, CAR + ESC, *steps)
    drive = tomllib.loads(text)["output"]["drive"]
    assert drive["backward_us"] == pytest.approx(1500 - 0.4 * 900)
    assert drive["forward_us"] == pytest.approx(1500 + 0.5 * 900)


@pytest.mark.parametrize("key", ["q", " ", "\x1b"])
def test_a_key_that_ends_the_calibration_discards_results(tmp_path: Path, key: str) -> None:
    """Q, Space and Escape end the calibration and discard results; N skips one output."""
    both = CAR + SERVO + MOTOR
    steps = (("full left", "n"), ("begins to move", "dddd\r"), ("Y or N", key))
    said, text = _calibrate(tmp_path, both, *steps)
    assert (text, "the profile was not changed" in said) == (both, True)


def test_an_error_keeps_earlier_results(tmp_path: Path) -> None:
    steps = [("begins to move", "dddd"), ("duty 0.16", "\r"), ("Y or N", "y")]
    for place in ("full left", "straight", "full right"):
        steps += [(place, ""), ("1500 µs", "\r")]
    said, text = _calibrate(tmp_path, CAR + MOTOR + SERVO, *steps, code=2)
    assert "must lie between" in said
    assert "Results so far" in said
    profile = tomllib.loads(text)
    assert profile["output"]["drive"]["start"] == pytest.approx(4 * 0.05 * 0.8)
    assert profile["output"]["steer"]["left_us"] == 1150
    assert "calibrated" not in profile["robot"]


def test_a_second_person_stops_a_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`robot stop` works while another client drives, and the stop stays in force."""
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


def test_a_served_twin_becomes_a_known_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    profile = write_profile(tmp_path, BLIND_CAR)
    serve = ("robot", "serve", str(profile.path), "--twin", "--no-announce", "--port", "0")
    serve += (*IN_A_ROOM, "--twin-folder", str(tmp_path))
    with Person(serve, tmp_path) as person:
        person.read_until("Known here as blind-car: `shapechanger robot drive blind-car`")
        person.read_until("blind-car listens at")
        with RobotClient.connect(recall("blind-car"), frames=False) as client:
            assert client.welcome.robot == "blind-car"
        person.process.terminate()
        assert person.end() == 0


@pytest.mark.gl
def test_a_person_lets_a_policy_drive_and_corrects_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """P lets the policy drive, a direction key takes control, and both drivers are recorded."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with run_robot(
        write_profile(tmp_path, PATIENT_CAR), arguments=("--world", "corridor")
    ) as robot:
        remember(replace(robot.known, name="car"))
        data = tmp_path / "data"
        command = ("robot", "drive", "car", "--policy", str(CLONES["car"]), "--record", str(data))
        with Person(command, tmp_path) as person:
            read = person.read_until("not armed")
            # The policy does not start by itself.
            read = person.read_until("recording", read)
            person.press("p")
            read = person.read_until("it drives", read)
            read = person.read_until("commanded by car", read)
            with robot.client(role="person", frames=False) as watcher:
                person.wait_for(lambda: watcher.ask().message.action_applied[1] != 0.0)
                person.press("w")
                person.wait_for(lambda: watcher.ask().message.holder_role == "person")
                for _ in range(5):
                    person.press("w")
                    person.wait_for(lambda: _is_corrected(watcher.ask().message))
            person.press("q")
            assert person.end() == 0
        (path,) = episodes_of(data)
        steps = read_episode(path).kept
        assert {step.driver for step in steps} == {"person", "program"}
        corrections = [step for step in steps if step.driver == "person" and step.wanted]
        assert corrections
        assert all(read_episode(path).jpeg(step) for step in steps)


def test_recordings_are_kept_after_a_failure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with (
        run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot,
        robot.client(role="person") as person,
    ):
        person.take()
        with pytest.raises(KeyboardInterrupt), recorded_to(tmp_path / "lost", person, "car"):
            raise KeyboardInterrupt
        message = " ".join(capsys.readouterr().err.split())
        assert f"`shapechanger robot fetch car --out {tmp_path / 'lost'}` downloads it" in message
        assert not (tmp_path / "lost").exists()
        person.record(on=False)

        with recorded_to(tmp_path / "kept", person, "car"):
            person.arm()
            for _ in range(20):
                person.exchange((0.0, 0.3), person.ask())
        (path,) = episodes_of(tmp_path / "kept")
        episode = read_episode(path)
        assert episode.closed
        assert len(episode.steps) == 20


def _is_corrected(seen: Observation) -> bool:
    return seen.commanded[1:] == (0.5,) and bool(seen.suggested)
