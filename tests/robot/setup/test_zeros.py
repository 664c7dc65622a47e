"""Zeros of joint encoders and tendon servos."""

from dataclasses import replace
from typing import Any

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.as5600 import SimulatedJoints
from shapechanger.robot.setup.calibration import find_joint_zeros, find_zeros
from shapechanger.robot.twin.ledger import TwinWiring
from shapechanger.robot.twin.room import DrivingWorld
from tests.robot.check.held_pins import shipped
from tests.robot.twin.in_process import LocalBoard

_RIG = replace(shipped("finger"), camera=None)
_CAR = replace(shipped("car"), camera=None)
_ZEROS = [1234, 4095, 0, 2]


class _Straight(DrivingWorld):
    """Joints held straight by hand, with a tremor; the servos pull springs, not a finger."""

    def __init__(self, tremble: float = 0.0) -> None:
        super().__init__({"tendon"}, (160, 120), seed=0)
        self._tremble = tremble

    def measured_angle(self, joint: str) -> float:
        self._tremble = -self._tremble
        return self._tremble


def _board(tremble: float = 0.0) -> LocalBoard:
    """Encoders whose true zeros are `_ZEROS`, and servos with a zero of 0."""

    def changed(one: Any, **settings: object) -> Any:
        return replace(one, settings={**one.settings, **settings})

    *others, joints = _RIG.sensors
    rows = joints.settings["rows"].items()
    zeroed = {n: {**row, "zero": zero} for (n, row), zero in zip(rows, _ZEROS, strict=True)}
    outputs = tuple(changed(output, zero=0) for output in _RIG.outputs)
    sensors = (*others, changed(joints, rows=zeroed))
    plan = replace(_RIG.guard_plan(), sensors=sensors, outputs=outputs)
    return LocalBoard(TwinWiring(plan), _Straight(tremble))


@pytest.mark.parametrize("tremble", [0.0, 0.02])
def test_zeros_are_the_counts_of_straight_joints(tremble: float) -> None:
    zeros = find_joint_zeros(_RIG, _board(tremble).hardware, lambda: None)
    names = ["MCP_flexion", "MCP_abduction", "PIP_flexion", "DIP_flexion"]
    assert zeros == {f"joints.{n}": zero for n, zero in zip(names, _ZEROS, strict=True)}


def test_a_missing_magnet_or_a_loose_tendon_is_an_error() -> None:
    """The error names the joint or tendon, and all servos are released; a car has neither."""
    board = _board()
    board.pins.of_kind(SimulatedJoints)[0].set_magnet("DIP_flexion", "gone")
    with pytest.raises(RobotError, match="DIP_flexion, on channel 3, detects no magnet"):
        find_joint_zeros(_RIG, board.hardware, lambda: None)
    rig = board.pins.require_rig()
    rig.break_servo("EIP", "snapped")
    with pytest.raises(RobotError, match="EIP"):
        find_zeros(_RIG, board.hardware, lambda: board.pass_ns(10_000_000))
    assert not any(servo.has_torque for servo in rig.servos.values())
    assert find_joint_zeros(_CAR, board.hardware, lambda: None) == {}
    with pytest.raises(RobotError, match="car has no tendons on a servo bus"):
        find_zeros(_CAR, board.hardware, lambda: None)
