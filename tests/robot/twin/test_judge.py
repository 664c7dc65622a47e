"""The ledger, also if it is damaged, and `unauthorised`, which finds violations in it."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.twin.ledger import (
    Transition,
    TwinWiring,
    propelled,
    read_ledger,
    time_to_rest,
    unauthorised,
)
from shapechanger.robot.twin.pin_board import PinBoard
from shapechanger.robot.twin.room import DrivingWorld
from tests.robot.twin.robots import ACTIONS, CAR, DRIVE, STEER, esc

_MS = 1_000_000
_NO_ONE_SHOT = TwinWiring(CAR, one_shot_ms=None)


def _pin(ms: float, pin: int, duty: float) -> Transition:
    return Transition(t=int(ms * _MS), kind="pin", pin=pin, duty=duty, hz=50)


def test_driving_without_permission_is_found() -> None:
    """The motion of an output that never comes to rest has no end; steering needs no permission."""
    for pin, sign in ((22, 1), (27, -1)):
        ledger = [_pin(10, pin, 0.5), _pin(11, pin, 0.0)]
        assert unauthorised(ledger, _NO_ONE_SHOT, [(9 * _MS, 250 * _MS)]) == []
        found = unauthorised(ledger, _NO_ONE_SHOT, [])
        assert found == [("drive", 10 * _MS, 11 * _MS, sign * 0.5)]
    found = unauthorised([_pin(10, 22, 0.5)], _NO_ONE_SHOT, [(10 * _MS, 260 * _MS)])
    assert found[0][1:3] == (260 * _MS, math.inf)
    assert time_to_rest([_pin(10, 22, 0.5)], _NO_ONE_SHOT, 10 * _MS) == math.inf
    # A duty below the start of the motor's motion counts as driving.
    plan = replace(CAR, outputs=(replace(DRIVE, settings={**DRIVE.settings, "start": 0.3}), STEER))
    assert unauthorised([_pin(10, 22, 0.01)], TwinWiring(plan, None), [])
    assert unauthorised([_pin(10, 17, 1.0)], _NO_ONE_SHOT, []) == []


def test_time_to_rest_ends_at_the_last_stop() -> None:
    ledger = [_pin(0, 22, 0.5), _pin(120, 22, 0.0), _pin(150, 22, 0.1), _pin(180, 22, 0.0)]
    assert time_to_rest(ledger, _NO_ONE_SHOT, 100 * _MS) == pytest.approx(0.08)
    assert time_to_rest(ledger, _NO_ONE_SHOT, 500 * _MS) == 0.0


def test_the_one_shot_stops_a_frozen_pin() -> None:
    """With a one-shot on the enable line, a pin that stays high drives for at most 100 ms."""
    toggles = [_pin(ms, 25, float(ms // 10 % 2)) for ms in range(10, 210, 10)]
    gone = [Transition(t=205 * _MS, kind="gone", pid=1), _pin(205, 22, 1.0), _pin(205, 25, 0.0)]
    ledger = sorted([*toggles, _pin(15, 22, 0.5), *gone], key=lambda line: line.t)
    assert time_to_rest(ledger, TwinWiring(CAR, 100.0), 205 * _MS) == pytest.approx(0.09, abs=0.006)
    for wiring in (_NO_ONE_SHOT, TwinWiring(plan=replace(CAR, enable_pin=None))):
        assert time_to_rest(ledger, wiring, 205 * _MS) == math.inf
    # If the enable line does not toggle, the motors have no power.
    assert propelled([_pin(10, 22, 0.5)], TwinWiring(CAR, 100.0)) == []


def test_braking_and_released_pins_count_as_rest() -> None:
    """Both bridge inputs high brake; a released pin falls to its pull-down."""
    ledger = [_pin(10, 22, 1.0), _pin(10, 27, 1.0)]
    assert propelled(ledger, _NO_ONE_SHOT) == []
    released = Transition(t=20 * _MS, kind="pin", pin=22, duty=0.0, hz=0, released=True)
    found = propelled([_pin(10, 22, 1.0), released], _NO_ONE_SHOT)
    assert [one.end_ns for one in found] == [20 * _MS]


def test_a_speed_controller_rests_near_neutral() -> None:
    """Pulses within one PCA9685 step of neutral, and no pulses, count as rest."""
    drive = esc("drive", "wheels", {"throttle": 1.0}, over="lgpio", pin=12)
    wiring = TwinWiring(replace(CAR, outputs=(drive,), enable_pin=None))

    def pulse(ms: int, us: float) -> Transition:
        return Transition(t=ms * _MS, kind="pulse", pin=12, us=us, hz=50)

    ledger = [pulse(0, 1503), pulse(10, 1600), pulse(20, 1497), pulse(30, 1300), pulse(40, 0)]
    found = propelled(ledger, wiring)
    assert [(one.start_ns / _MS, one.end_ns / _MS) for one in found] == [(10, 20), (30, 40)]
    assert [one.value for one in found] == pytest.approx([0.2, -0.4])
    frozen = [pulse(0, 1600), _pin(10, 12, 1.0)]
    assert time_to_rest(frozen, wiring, 0) == pytest.approx(0.01)


_TIMES = st.integers(0, 2000)


@given(
    duties=st.lists(st.tuples(_TIMES, st.sampled_from([0.0, 0.3, 1.0])), max_size=20),
    arrivals=st.lists(_TIMES, max_size=20),
)
def test_violations_agree_with_a_brute_force_check(
    duties: list[tuple[int, float]], arrivals: list[int]
) -> None:
    """At each sampled time, `unauthorised` reports exactly the motion without permission."""
    ledger = [_pin(ms, 22, duty) for ms, duty in sorted(duties, key=lambda one: one[0])]
    wiring = TwinWiring(replace(CAR, actions=ACTIONS), None)
    permitted = [(ms * _MS, (ms + 250) * _MS) for ms in arrivals]
    found = unauthorised(ledger, wiring, permitted)
    for ms in range(0, 2500, 7):
        now = ms * _MS + 1
        duty = ([line.duty for line in ledger if line.t <= now] or [0.0])[-1]
        allowed = any(arrival * _MS <= now < (arrival + 250) * _MS for arrival in arrivals)
        reported = any(one.start_ns <= now < one.end_ns for one in found)
        assert reported == (duty != 0.0 and not allowed)


def test_a_ledger_round_trips(tmp_path: Path) -> None:
    path = tmp_path / "ledger.jsonl"
    with path.open("xb", buffering=0) as file:
        board = PinBoard(TwinWiring(CAR), DrivingWorld((), (8, 6), 0), file, 0, lambda: 9)
        board.record("pin", 7, pin=22, duty=0.4, hz=50, pid=1)
        board.record("i2c", 5, bus=1, address=64, register=6, data=[1, 2], pid=1)
        board.record("pulse", pin=12, us=1500, hz=50, pid=1)
        with pytest.raises(ValueError, match="JSON"):
            board.record("pulse", us=math.nan)
    assert read_ledger(path) == [
        Transition(5, "i2c", pid=1, bus=1, address=64, register=6, data=(1, 2)),
        Transition(7, "pin", pid=1, pin=22, duty=0.4, hz=50),
        Transition(9, "pulse", pid=1, pin=12, us=1500, hz=50),
    ]


@pytest.mark.parametrize("cut", range(1, 20))
def test_a_truncated_last_line_is_skipped(tmp_path: Path, cut: int) -> None:
    """A writer that dies in the middle of a line loses only that line."""
    path = tmp_path / "ledger.jsonl"
    path.write_text('{"t": 1, "kind": "gone", "pid": 1}\n{"t": 2, "kind": "gone"}\n'[:-cut])
    assert read_ledger(path) == [Transition(1, "gone", pid=1)]


def test_a_malformed_line_in_the_middle_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "ledger.jsonl"
    path.write_text('{"t": 1, "kind": "gone"}\n{"t": 2, "ki\n{"t": 3, "kind": "gone"}\n')
    with pytest.raises(RobotError, match=r"Line 2 of .*ledger\.jsonl is malformed"):
        read_ledger(path)
