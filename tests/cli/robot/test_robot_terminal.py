"""Driving and calibrating a twin from a terminal."""

import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.client.known_robots import KnownRobot, remember
from shapechanger.robot.twin.robot import run_robot
from tests.cli.robot.typing import Person
from tests.robot.client.robot import eventually
from tests.robot.client.sequences import UNKNOWN
from tests.robots import CAR, IN_A_ROOM, PATIENT_CAR, changed, write_profile

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


def test_driving(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """E arms, W drives, X disarms, Space and Escape stop, Q leaves, and sequences do nothing."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with (
        run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot,
        robot.operator() as operator,
        robot.client(frames=False) as watcher,
    ):
        known = robot.known
        remember(KnownRobot("car", known.address, known.key, known.fingerprint))
        operator.place(0)
        start = operator.where().travelled_m
        with Person(
            ("robot", "drive", "car", "--cap", "1.0"), tmp_path, {"XDG_CONFIG_HOME": str(tmp_path)}
        ) as person:

            def press_unknown_sequences(first: int) -> None:
                """Press a third of them in two writes each; the robot must stay as it is."""
                before = watcher.ask().message
                for n, sequence in enumerate(UNKNOWN[first::3]):
                    if sequence not in {b"\x03", b"\x1a"}:  # Ctrl-C and Ctrl-Z are signals.
                        place = n % len(sequence)
                        person.press(sequence[:place])
                        person.press(sequence[place:])
                        seen = watcher.ask().message
                        assert not any(seen.commanded), sequence
                        assert seen.armed == before.armed, sequence
                        assert seen.holder == before.holder, sequence

            person.read_until("not armed")
            press_unknown_sequences(0)
            person.press("e")
            read = person.read_until("\rarmed · cap 1.0")
            person.press("w")
            person.wait_for(lambda: operator.where().travelled_m - start > 0.1)
            # Without key repeats, driving stops.
            person.wait_for(lambda: operator.where().speed < 0.05)
            press_unknown_sequences(1)
            person.press("x")
            read = person.read_until("not armed", read)
            person.press(" ")
            read = person.read_until("EMERGENCY STOP", read)
            person.press("e")
            read = person.read_until("\rarmed · cap 1.0", read)
            person.press("\x1b")
            person.read_until("EMERGENCY STOP", read)
            press_unknown_sequences(2)
            assert watcher.ask().message.emergency
            person.press("q")
            assert person.end() == 0


PLOUGH = """\
[robot]
name = "plough"
body = "truck"

[action.throttle]
propels = true

[action.blade]
one_sided = true
rest = 1.0

[output.drive]
driver = "hbridge"
part = "wheels"
forward = 22
backward = 27
mix = { throttle = 1.0 }

[output.blade]
driver = "servo"
over = "lgpio"
pin = 18
mix = { blade = 1.0 }

[limits]
deadline_ms = 1000
"""
"""A truck whose blade is up at rest, and has no key."""


def test_actions_without_a_key_stay_at_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A blade that is up at rest stays up, whatever the cap."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with (
        run_robot(write_profile(tmp_path, PLOUGH), arguments=IN_A_ROOM) as robot,
        robot.operator() as operator,
    ):
        known = robot.known
        remember(KnownRobot("plough", known.address, known.key, known.fingerprint))
        operator.place(0)
        start = operator.where().travelled_m
        with (
            Person(
                ("robot", "drive", "plough", "--cap", "0.5"),
                tmp_path,
                {"XDG_CONFIG_HOME": str(tmp_path)},
            ) as person,
            robot.client(frames=False) as watcher,
        ):
            person.read_until("not armed")
            person.press("e")
            person.read_until("\rarmed · cap 0.5")
            person.press("w")
            person.wait_for(lambda: operator.where().travelled_m - start > 0.1)
            assert watcher.ask().message.action_applied[1] == pytest.approx(1.0)
            person.press("q")
            assert person.end() == 0


@pytest.mark.skipif(sys.platform != "linux", reason="Needs the parent-death signal.")
def test_killing_the_command_ends_its_robot(tmp_path: Path) -> None:
    """Closing the terminal must not leave an armed robot."""
    profile = write_profile(tmp_path, MOTOR)
    with Person(("robot", "calibrate", str(profile.path), "--twin"), tmp_path, {}) as person:
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
    with Person(("robot", "calibrate", str(profile.path), "--twin"), folder, {}) as person:
        read = 0
        for prompt, keys in steps:
            read = person.read_until(prompt, read)
            person.press(keys)
        assert person.end() == code, person.text
        return person.text, profile.path.read_text()


def _output(text: str, name: str) -> dict[str, Any]:
    return tomllib.loads(text)["output"][name]


def test_calibrating_a_servo(tmp_path: Path) -> None:
    """Ends and centre are written, and other lines kept."""
    steps = (
        ("full left", "a" * 25 + "\r"),  # From 1500 us to the left, 2 % of 900 us each.
        ("straight", "d\r"),
        ("full right", "d" * 20 + "\r"),
    )
    _, text = _calibrate(tmp_path, SERVO, *steps)
    steer = _output(text, "steer")
    assert steer["left_us"] == pytest.approx(1500 - 0.5 * 900)
    assert steer["centre_us"] == pytest.approx(1500 + 0.02 * 900)
    assert steer["right_us"] == pytest.approx(1500 + 0.4 * 900)
    for kept in ("# Full left.", "# Not touched.", "calibrated = "):
        assert kept in text


def test_calibrating_a_motor(tmp_path: Path) -> None:
    """The start duty is written; a reversed motor gets a negative mix."""
    steps = (("begins to move", "d" * 4 + "\r"), ("Y or N", "n"))
    _, text = _calibrate(tmp_path, MOTOR, *steps)
    drive = _output(text, "drive")
    assert drive["start"] == pytest.approx(4 * 0.05 * 0.8)
    assert drive["mix"] == {"throttle": -0.8}
    assert "# Header place 15." in text


def test_an_esc_goes_beyond_the_cap_only_when_asked(tmp_path: Path) -> None:
    """Values are limited to the cap until the person confirms."""
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


@pytest.mark.parametrize("key", ["q", " ", "\x1b", "n"])
def test_ending_writes_nothing_and_goes_no_further(tmp_path: Path, key: str) -> None:
    """Q, Space and Escape end the calibration and discard results; N skips one output."""
    second = MOTOR.partition("[action.throttle]")
    both = SERVO + "\n" + second[1] + second[2]
    if key == "n":
        steps = (("full left", "n"), ("begins to move", "n"))
        said, text = _calibrate(tmp_path, both, *steps)
    else:
        found = (("full left", "n"), ("begins to move", "dddd\r"), ("Y or N", key))
        said, text = _calibrate(tmp_path, both, *found)
        assert (text, "nothing was written" in said) == (both, True)
        said, text = _calibrate(tmp_path, both, ("full left", key))
        assert "begins to move" not in said
    assert (text, "nothing was written" in said) == (both, True)


def test_an_action_that_is_capped(tmp_path: Path) -> None:
    """The value written is the one applied, not the one requested."""
    capped = changed("gain = 1.0  # Not touched.", "low = -0.3", SERVO)
    steps = (("full left", "a" * 40 + "\r"), ("straight", "\r"), ("full right", "d" * 10 + "\r"))
    _, text = _calibrate(tmp_path, capped, *steps)
    assert _output(text, "steer")["left_us"] == pytest.approx(1500 - 0.3 * 900)


@pytest.mark.slow
def test_faults_on_a_twin(tmp_path: Path) -> None:
    """Each fault is tried once, and a missed promise sets the exit code."""
    text = changed('[camera]\ndriver = "picamera2"\nsize = [160, 120]\nfps = 20\n\n', "", CAR)
    profile = write_profile(tmp_path, changed("camera_stale_ms = 500\n", "", text))
    with Person(("robot", "check", str(profile.path), "--faults"), tmp_path, {}) as person:
        code = person.end(200.0)
        output = person.text
    assert "This robot has no camera" in output
    assert "At rest never" not in output
    assert "It did not drive" not in output
    assert code == (1 if "BAD" in output else 0)


def test_an_error_halfway_keeps_what_was_found_before(tmp_path: Path) -> None:
    """The motor's results are written, and the robot does not count as calibrated."""
    second = SERVO.partition("[action.steering]")
    steps = [("begins to move", "dddd"), ("duty 0.16", "\r"), ("Y or N", "y")]
    for place in ("full left", "straight", "full right"):
        steps += [(place, ""), ("1500 µs", "\r")]
    both = MOTOR + "\n" + second[1] + second[2]
    said, text = _calibrate(tmp_path, both, *steps, code=2)
    assert "must lie between" in said
    assert "Results so far" in said
    assert _output(text, "drive")["start"] == pytest.approx(4 * 0.05 * 0.8)
    assert _output(text, "steer")["left_us"] == 1150
    assert "calibrated" not in tomllib.loads(text)["robot"]


def test_a_cap_below_a_threshold_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three-level steering does nothing below its threshold, and the person is told."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot:
        known = robot.known
        remember(KnownRobot("car", known.address, known.key, known.fingerprint))
        with Person(
            ("robot", "drive", "car", "--cap", "0.2"), tmp_path, {"XDG_CONFIG_HOME": str(tmp_path)}
        ) as person:
            person.read_until("not armed")
            person.press("e")
            person.read_until("\rarmed · cap 0.2")

            def holds_d() -> bool:
                person.press("d")
                return "a steering of 0.2 moves nothing here" in person.text

            person.wait_for(holds_d)
            person.press("q")
            assert person.end() == 0


def test_a_person_lets_a_waiting_program_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """P hands the armed robot to the program, and the person can still stop it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with (
        run_robot(write_profile(tmp_path, PATIENT_CAR), arguments=IN_A_ROOM) as robot,
        robot.operator() as operator,
    ):
        known = robot.known
        remember(KnownRobot("car", known.address, known.key, known.fingerprint))
        operator.place(0)
        with Person(
            ("robot", "drive", "car"), tmp_path, {"XDG_CONFIG_HOME": str(tmp_path)}
        ) as person:
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
            person.press("q")
            assert person.end() == 0
