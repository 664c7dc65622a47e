"""Zeros of joint encoders and tendon servos, and the checks of encoders."""

from __future__ import annotations

import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.check.standing import StandingRobot, examine
from shapechanger.robot.drivers.as5600 import Magnet
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.setup.calibration import find_joint_zeros, find_zeros
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.check.held_pins import shipped
from tests.robot.twin.in_process import LocalBoard

_RIG = replace(shipped("finger"), camera=None)
_CAR = replace(shipped("car"), camera=None)
_ZEROS = [1234, 4095, 0, 2]


class _Straight(DrivingWorld):
    """Joints held straight by hand, with a tremor; springs replace the finger."""

    def __init__(self, tremble: float = 0.0) -> None:
        super().__init__({"tendon"}, (160, 120), seed=0)
        self._tremble = tremble

    def measured_angle(self, joint: str) -> float:
        self._tremble = -self._tremble
        return self._tremble


def _board(tremble: float = 0.0, servo_zero: int = 0) -> LocalBoard:
    """Encoders whose true zeros are `_ZEROS`, and servos with a true zero."""

    def changed(one: Any, **settings: object) -> Any:
        return replace(one, settings={**one.settings, **settings})

    sensors = [changed(s, zeros=_ZEROS) if s.driver == "as5600" else s for s in _RIG.sensors]
    outputs = [changed(output, zero=servo_zero) for output in _RIG.outputs]
    plan = replace(_RIG.guard_plan(), sensors=tuple(sensors), outputs=tuple(outputs))
    return LocalBoard(TwinWiring(plan), _Straight(tremble))


@pytest.mark.parametrize("tremble", [0.0, 0.02])
def test_zeros_are_the_counts_of_straight_joints(tremble: float) -> None:
    """Zeros are keyed by joint, and averaged correctly around count 0."""
    zeros = find_joint_zeros(_RIG, _board(tremble).hardware, lambda: None)
    names = ["MCP_flexion", "MCP_abduction", "PIP_flexion", "DIP_flexion"]
    assert zeros == {f"joints.{n}": zero for n, zero in zip(names, _ZEROS, strict=True)}


def test_a_missing_magnet_is_an_error() -> None:
    """The error names the encoder; a robot without encoders has no zeros."""
    board = _board()
    board.pins.encoder("DIP_flexion").set_magnet("gone")
    with pytest.raises(RobotError, match="DIP_flexion, on channel 3, detects no magnet"):
        find_joint_zeros(_RIG, board.hardware, lambda: None)
    assert find_joint_zeros(_CAR, board.hardware, lambda: None) == {}


def test_zeros_are_measured_with_taut_tendons() -> None:
    """All servos are released afterwards."""
    board = _board(servo_zero=5000)
    zeros = find_zeros(_RIG, board.hardware, lambda: board.pass_ns(10_000_000))
    # 3 N less the 0.5 N of the gears against a spring of 300 N/m: 8.3 mm, of 62.8 mm a turn.
    assert list(zeros) == ["FDP", "FDS", "EIP", "EDC", "LUM", "DI", "PI"]
    assert zeros["FDP"] == pytest.approx(5000 + 4096 * 0.0083 / 0.0628, abs=60)
    assert not any(servo.has_torque for servo in board.pins.require_rig().bus.servos.values())


def test_a_loose_tendon_is_an_error() -> None:
    """The error names the tendon, and all servos are released; a car has no tendons."""
    board = _board()
    board.pins.require_rig().break_servo("EIP", "snapped")
    with pytest.raises(RobotError, match="EIP"):
        find_zeros(_RIG, board.hardware, lambda: board.pass_ns(10_000_000))
    assert not any(servo.has_torque for servo in board.pins.require_rig().bus.servos.values())
    with pytest.raises(RobotError, match="car has no tendons on a servo bus"):
        find_zeros(_CAR, board.hardware, lambda: None)


def _found(
    root: Path, board: LocalBoard, port: int = 0, profile: Profile = _RIG
) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    robot = StandingRobot(profile, port, root, hardware=lambda: board.hardware)
    for one in examine(robot):
        found.setdefault(one.check, []).append(f"{one.level}: {one.sentence}")
    return found


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A computer with an I2C bus of 400 kHz."""
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev/i2c-1").touch()
    (tmp_path / "boot").mkdir()
    (tmp_path / "boot/config.txt").write_text("dtparam=i2c_arm=on,i2c_arm_baudrate=400000\n")
    return tmp_path


@pytest.mark.parametrize(
    ("how", "expected"),
    [
        ("", "good: The encoder of PIP_flexion detects its magnet."),
        ("gone", "bad: The encoder of PIP_flexion detects no magnet: fit one above the chip."),
        ("weak", "bad: The magnet of PIP_flexion is too far from its encoder."),
        ("strong", "bad: The magnet of PIP_flexion is too near to its encoder."),
    ],
)
def test_each_magnet_is_checked(root: Path, how: Magnet, expected: str) -> None:
    """A missing, weak or strong magnet is reported for its joint only."""
    board = _board()
    board.pins.encoder("PIP_flexion").set_magnet(how)
    found = _found(root, board)["encoders"]
    assert found[2] == expected
    assert [one.partition(":")[0] for one in found[:2]] == ["good"] * 2


def test_the_check_names_a_chip_that_does_not_answer(root: Path) -> None:
    """A dead multiplexer is reported for each joint behind it."""
    board = _board()
    board.pins.dead_chips.add((1, 0x70))
    found = _found(root, board)["encoders"]
    assert len(found) == 4
    assert all("The multiplexer of sensor 'joints' at 0x70" in one for one in found)


def test_checks_leave_the_encoders_of_a_served_robot_alone(root: Path) -> None:
    """Selecting a channel would disturb the readings of a running guard."""
    with socket.socket() as taken:
        taken.bind(("", 0))
        taken.listen()
        found = _found(root, _board(), port=taken.getsockname()[1])
    assert "encoders" not in found
    assert found["wiring"] == [
        "unknown: The robot may be served now, so its pins and buses were left alone."
    ]


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        ("dtparam=i2c_arm_baudrate=1000000", "good"),
        ("dtparam=i2c_arm=on", "bad"),
        ("#dtparam=i2c_arm_baudrate=400000", "bad"),
        ("dtparam=i2c_arm_baudrate=100000", "bad"),
    ],
)
def test_the_bus_speed_is_checked(root: Path, config: str, expected: str) -> None:
    """The check applies only to robots with encoders."""
    (root / "boot/config.txt").write_text(config)
    assert _found(root, _board())["I2C speed"][0].startswith(expected)
    assert "I2C speed" not in _found(root, _board(), profile=_CAR)
