"""Twin time: it advances only on request, and waits for all participants."""

import asyncio
from pathlib import Path

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.twin.board import START_NS
from shapechanger.robot.twin.hardware import connect
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.start import start_board
from tests.robot.twin.robots import CAR, process

pytestmark = pytest.mark.realtime

_WAITER = """
import sys
from shapechanger.robot.twin.hardware import connect
clock = connect(sys.argv[1]).clock
clock.wait([], 2**62, 0.0)  # Become a participant.
print("waits", flush=True)
while True:
    clock.wait([], 2**62, 0.2)
"""


def test_time_does_not_wait_for_a_dead_participant(tmp_path: Path) -> None:
    with start_board(CAR, "twin", tmp_path) as board, Operator(board.socket_path) as operator:
        with process(_WAITER, board.socket_path):
            operator.advance(0.1)
        before = operator.advance(0.0)
        assert operator.advance(1.0) == before + 1_000_000_000


def test_a_wait_ends_although_time_stands_still(tmp_path: Path) -> None:
    """`wait` returns False after its time limit, so that a guard can send heartbeats."""
    with start_board(CAR, "twin", tmp_path) as board:
        hardware = connect(board.socket_path)
        clock = hardware.clock
        assert not clock.wait([], 2**62, 0.01)
        assert not clock.wait([], 2**62, 0.01)
        assert clock.now_ns() == START_NS
        hardware.close()


def test_sleep_advances_the_clock(tmp_path: Path) -> None:
    """Sleeps may overlap, end on time, and return the capture time of the newest frame."""
    with start_board(CAR, "twin", tmp_path, CameraPlan("pipe", fps=20.0)) as board:
        hardware = connect(board.socket_path)
        clock = hardware.clock

        async def sleep() -> None:
            assert await clock.sleep(0.03) is None  # The pipe has no reader.
            assert clock.now_ns() == START_NS + 30_000_000
            await asyncio.gather(clock.sleep(0.05), clock.sleep(0.05))
            assert START_NS + 80_000_000 <= clock.now_ns() <= START_NS + 130_000_000
            sleeping = asyncio.ensure_future(clock.sleep(0.02))
            sleeping.cancel()
            with pytest.raises(asyncio.CancelledError):
                await sleeping

        asyncio.run(sleep())
        with board.fifo_path.open("rb"):
            captured_ns = asyncio.run(clock.sleep(0.2))
        assert captured_ns is not None
        assert clock.now_ns() - 50_000_000 < captured_ns <= clock.now_ns()
        hardware.close()


def test_in_real_time_the_clock_runs_by_itself(tmp_path: Path) -> None:
    with start_board(CAR, "real", tmp_path) as board, Operator(board.socket_path) as operator:
        with pytest.raises(RobotError, match="real time"):
            operator.advance(1.0)
        hardware = connect(board.socket_path)
        clock = hardware.clock
        end = clock.now_ns() + 20_000_000
        assert clock.wait([], end, 1.0)
        assert clock.now_ns() >= end
        assert not clock.wait([], end + 10**12, 0.01)
        assert asyncio.run(clock.sleep(0.001)) is None
        hardware.close()


def test_using_a_closed_board_raises(tmp_path: Path) -> None:
    with start_board(CAR, "twin", tmp_path) as board:
        hardware = connect(board.socket_path)
    clock = hardware.clock
    with pytest.raises(RobotError, match="board has ended"):
        clock.wait([], 2**62, 1.0)
    with pytest.raises(RobotError, match="board has ended"):
        asyncio.run(clock.sleep(1.0))
    hardware.close()
