"""Driving and calibrating a twin from a terminal."""

import sys
import tomllib
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.client.known_robots import remember
from shapechanger.robot.twin.robot import Operator, RunningRobot, run_robot
from tests.cli.robot.typing import Person
from tests.robot.client.robot import eventually
from tests.robots import IN_A_ROOM, PATIENT_CAR, changed, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

SERVO = """\
# A car with a servo to calibrate.

[robot]
name = "servo-car"
body = "car"

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

MOTOR = """\
# A car with a motor to calibrate.

[robot]
name = "motor-car"
body = "car"

[action.throttle]
propels = true

[output.drive]
driver = "hbridge"
part = "wheels"
forward = 22  # Header place 15.
backward = 27
mix = { throttle = 0.8 }
"""

ESC = """\
[robot]
name = "esc-car"
body = "car"

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

# A car whose blade is up at rest, and has no key.
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
    """Drive a served car from a terminal, with `folder` as the home; Q ends it."""
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
                person.press("q")  # Just after Escape it belongs to a sequence.
                return person.process.poll() is not None

            person.wait_for(leaves)
            assert person.end() == 0


def test_driving(tmp_path: Path) -> None:
    """E arms, W drives, X disarms, Space and Escape stop, and Q leaves."""
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
    """Three-level steering does nothing below its threshold, and the person is told."""
    with _at_the_terminal(tmp_path, "0.2") as (_, _, person):
        person.read_until("not armed")
        person.press("e")
        person.read_until("\rarmed · cap 0.2")

        def holds_d() -> bool:
            person.press("d")
            return "a steering of 0.2 moves nothing here" in person.text

        person.wait_for(holds_d)


def test_a_person_lets_a_waiting_program_drive(tmp_path: Path) -> None:
    """P hands the armed robot to the program, and the person can still stop it."""
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
    """Closing the terminal must not leave an armed robot."""
    profile = write_profile(tmp_path, MOTOR)
    with Person(("robot", "calibrate", str(profile.path), "--twin"), tmp_path) as person:
        person.read_until("begins to move")
        # The supervisor, and below it guard and daemon.
        person.wait_for(lambda: len(_below(person.process.pid)) >= 3)
        robot = _below(person.process.pid)
        person.process.kill()
        person.process.wait(20.0)
    eventually(lambda: not any(Path(f"/proc/{pid}").exists() for pid in robot))


def _below(pid: int) -> list[int]:
    """Return the pids of all descendants of a process."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except FileNotFoundError:
        return []
    return [one for child in map(int, children) for one in (child, *_below(child))]


def _calibrate(folder: Path, text: str, *steps: tuple[str, str], code: int = 0) -> tuple[str, str]:
    """Press keys after each prompt, and return its output and the profile afterwards."""
    profile = write_profile(folder, text)
    with Person(("robot", "calibrate", str(profile.path), "--twin"), folder) as person:
        read = 0
        for prompt, keys in steps:
            read = person.read_until(prompt, read)
            person.press(keys)
        assert person.end() == code, person.text
        return person.text, profile.path.read_text()


def _output(text: str, name: str) -> dict[str, Any]:
    return tomllib.loads(text)["output"][name]


def _with(first: str, second: str) -> str:
    return f"{first}\n[action{second.partition('[action')[2]}"


def test_calibrating_a_motor_and_a_servo(tmp_path: Path) -> None:
    """What was found is written, a reversed motor gets a negative mix, and other lines stay."""
    steps = (
        ("begins to move", "d" * 4 + "\r"),
        ("Y or N", "n"),
        ("full left", "a" * 25 + "\r"),  # From 1500 us to the left, 2 % of 900 us each.
        ("straight", "d\r"),
        ("full right", "d" * 20 + "\r"),
    )
    _, text = _calibrate(tmp_path, _with(MOTOR, SERVO), *steps)
    drive, steer = _output(text, "drive"), _output(text, "steer")
    assert drive["start"] == pytest.approx(4 * 0.05 * 0.8)
    assert drive["mix"] == {"throttle": -0.8}
    assert steer["left_us"] == pytest.approx(1500 - 0.5 * 900)
    assert steer["centre_us"] == pytest.approx(1500 + 0.02 * 900)
    assert steer["right_us"] == pytest.approx(1500 + 0.4 * 900)
    for kept in ("# Header place 15.", "# Full left.", "# Not touched.", "calibrated = "):
        assert kept in text


def test_an_esc_goes_beyond_the_cap_only_when_asked(tmp_path: Path) -> None:
    steps = (
        ("fastest backward", "a" * 40),
        ("Go beyond it?", "\r"),
        ("surely at rest", "\r"),
        ("fastest forward", "d" * 40),
        ("Go beyond it?", "y" + "d" * 5 + "\r"),
    )
    _, text = _calibrate(tmp_path, ESC, *steps)
    drive = _output(text, "drive")
    assert drive["backward_us"] == pytest.approx(1500 - 0.4 * 900)
    assert drive["forward_us"] == pytest.approx(1500 + 0.5 * 900)


@pytest.mark.parametrize("key", ["q", " ", "\x1b"])
def test_ending_writes_nothing_and_goes_no_further(tmp_path: Path, key: str) -> None:
    """Q, Space and Escape end the calibration and discard results; N skips one output."""
    both = _with(SERVO, MOTOR)
    steps = (("full left", "n"), ("begins to move", "dddd\r"), ("Y or N", key))
    said, text = _calibrate(tmp_path, both, *steps)
    assert (text, "nothing was written" in said) == (both, True)


def test_an_error_halfway_keeps_what_was_found_before(tmp_path: Path) -> None:
    """The motor's results are written, and the robot does not count as calibrated."""
    steps = [("begins to move", "dddd"), ("duty 0.16", "\r"), ("Y or N", "y")]
    for place in ("full left", "straight", "full right"):
        steps += [(place, ""), ("1500 µs", "\r")]
    said, text = _calibrate(tmp_path, _with(MOTOR, SERVO), *steps, code=2)
    assert "must lie between" in said
    assert "Results so far" in said
    assert _output(text, "drive")["start"] == pytest.approx(4 * 0.05 * 0.8)
    assert _output(text, "steer")["left_us"] == 1150
    assert "calibrated" not in tomllib.loads(text)["robot"]
