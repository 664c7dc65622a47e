"""Zeros of the tendon servos."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.setup.zeros import find_zeros
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.in_process import LocalBoard


def _board(plan: GuardPlan) -> LocalBoard:
    # Springs replace the finger.
    return LocalBoard(TwinWiring(plan), DrivingWorld({"tendon"}, (160, 120), seed=0))


def _plan(zero: int) -> GuardPlan:
    plan = load_profile(find_profile("finger")).guard_plan()
    outputs = tuple(replace(o, settings={**o.settings, "zero": zero}) for o in plan.outputs)
    return replace(plan, outputs=outputs)


def test_zeros_are_measured_with_taut_tendons() -> None:
    """All servos are released afterwards."""
    board = _board(_plan(5000))
    zeros = find_zeros(_plan(0), board.hardware, lambda: board.pass_ns(10_000_000))
    # 3 N less the 0.5 N of the gears against a spring of 300 N/m: 8.3 mm, of 62.8 mm a turn.
    assert list(zeros) == ["FDP", "FDS", "EIP", "EDC", "LUM", "DI", "PI"]
    assert zeros["FDP"] == pytest.approx(5000 + 4096 * 0.0083 / 0.0628, abs=60)
    assert board.pins.rig is not None
    assert not any(servo.has_torque for servo in board.pins.rig.bus.servos.values())


def test_a_loose_tendon_is_an_error() -> None:
    """The error names the tendon, and all servos are released."""
    board = _board(_plan(0))
    assert board.pins.rig is not None
    board.pins.rig.break_servo("EIP", "snapped")
    with pytest.raises(RobotError, match="EIP"):
        find_zeros(
            _plan(0),
            board.hardware,
            lambda: board.pass_ns(10_000_000),
        )
    assert not any(servo.has_torque for servo in board.pins.rig.bus.servos.values())


def test_a_car_has_no_tendons() -> None:
    """A robot without a servo bus raises an error."""
    plan = load_profile(find_profile("car")).guard_plan()
    with pytest.raises(RobotError, match="car has no tendons on a servo bus"):
        find_zeros(plan, _board(_plan(0)).hardware, lambda: None)
