"""Reading and writing the ledger, including damaged files."""

import math
from pathlib import Path

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.twin.pin_board import PinBoard
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.signals import Transition, read_ledger
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.robots import CAR


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
