"""A board in the same process: pins, chips and time without sockets."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from gpiozero import DigitalInputDevice, DigitalOutputDevice, Motor

from shapechanger.errors import RobotError
from shapechanger.robot.twin.in_process import LocalBoard
from shapechanger.robot.twin.server import START_NS
from shapechanger.robot.twin.wiring import TwinWiring
from shapechanger.robot.twin.world.vehicle import DrivingWorld
from tests.robot.twin.robots import CAR

_MS = 1_000_000


def _board() -> tuple[LocalBoard, DrivingWorld]:
    world = DrivingWorld({"wheels", "steering"}, (160, 120), seed=1)
    return LocalBoard(TwinWiring(CAR), world), world


def test_time_moves_only_by_advance() -> None:
    """Time starts at the twin's start time and changes only by `advance`."""
    board, _ = _board()
    assert board.now_ns() == board.hardware.clock.now_ns() == START_NS
    board.advance(START_NS + 10 * _MS)
    assert board.hardware.clock.now_ns() == START_NS + 10 * _MS


@pytest.mark.parametrize(
    "wait",
    [
        lambda clock: clock.wait([], START_NS + 1, 0.1),
        lambda clock: asyncio.run(clock.sleep(0.1)),
    ],
    ids=["wait", "sleep"],
)
def test_waiting_raises(wait: Callable[[Any], object]) -> None:
    """Waiting raises, because no other process could advance the time."""
    board, _ = _board()
    with pytest.raises(RobotError, match="advances only by `advance`"):
        wait(board.hardware.clock)


def test_a_pin_drives_the_world() -> None:
    """A gpiozero motor moves the vehicle once the enable pin is on."""
    board, world = _board()
    factory = board.hardware.pin_factory()
    assert board.hardware.pin_factory() is factory
    motor = Motor(22, 27, pin_factory=factory)
    enable = DigitalOutputDevice(25, pin_factory=factory)
    motor.value = 1.0
    begin = world.inputs().travelled_m
    board.advance(START_NS + 200 * _MS)
    assert world.inputs().travelled_m == begin
    enable.on()
    board.advance(START_NS + 400 * _MS)
    assert world.inputs().travelled_m > begin
    board.hardware.close()


def test_edges_of_unclaimed_pins_are_ignored() -> None:
    """Edges reach only the device that claimed the pin, with the level at that time."""
    board, world = _board()
    factory = board.hardware.pin_factory()
    motor, enable = Motor(22, 27, pin_factory=factory), DigitalOutputDevice(25, pin_factory=factory)
    motor.value = 1.0
    enable.on()
    encoder = DigitalInputDevice(5, pin_factory=factory)  # Its other channel, 6, is not claimed.
    edges: list[int] = []
    encoder.when_activated = lambda: edges.append(encoder.value)
    for i in range(1, 100):
        board.advance(START_NS + 10 * i * _MS)
    assert world.inputs().travelled_m > 0.1
    assert len(edges) > 3
    assert set(edges) == {1}
    board.hardware.close()


def test_closing_is_idempotent() -> None:
    """Closing the hardware twice raises no error."""
    board, _ = _board()
    board.hardware.pin_factory()
    board.hardware.close()
    board.hardware.close()
