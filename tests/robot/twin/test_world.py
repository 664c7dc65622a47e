"""Properties of the room and of the vehicles in it, without any process."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.contract.world import Pose
from shapechanger.errors import RobotError
from shapechanger.robot.twin.room import RADIUS, ROOM_LENGTH, ROOM_WIDTH, DrivingWorld

_SIZE = (160, 120)

# Outputs that drive each vehicle straight ahead, and outputs that turn it left.
_VEHICLES = {
    "car": ({"wheels": 1.0, "steering": 0.0}, {"wheels": 0.5, "steering": -1.0}),
    "tank": ({"left track": 1.0, "right track": 1.0}, {"left track": -0.5, "right track": 0.5}),
    "boat": ({"propeller": 1.0, "rudder": 0.0}, {"propeller": 0.7, "rudder": -1.0}),
    "twin boat": (
        {"left propeller": 1.0, "right propeller": 1.0},
        {"left propeller": 0.0, "right propeller": 0.8},
    ),
}


def _clearance(pose: Pose) -> float:
    return min(pose.x, pose.y, ROOM_LENGTH - pose.x, ROOM_WIDTH - pose.y)


def _run(world: DrivingWorld, outputs: dict[str, float], seconds: float) -> None:
    for _ in range(round(seconds * 100)):
        world.advance(0.01, outputs)


def _driven(kind: str, outputs: dict[str, float], seconds: float) -> DrivingWorld:
    world = DrivingWorld(_VEHICLES[kind][0], _SIZE, seed=1)
    _run(world, outputs, seconds)
    return world


@pytest.mark.parametrize("kind", _VEHICLES)
def test_ahead_is_along_the_heading_and_left_is_counter_clockwise(kind: str) -> None:
    """Mirrored outputs turn right by the same angle; negated outputs drive backward."""
    ahead, left = _VEHICLES[kind]
    start = _driven(kind, {}, 0.0).inputs().pose
    seen = _driven(kind, ahead, 0.8).inputs()
    assert seen.travelled_m > 0.1
    way = seen.travelled_m * np.array([math.cos(start.heading), math.sin(start.heading)])
    assert (seen.pose.x, seen.pose.y) == pytest.approx((start.x + way[0], start.y + way[1]))
    assert seen.pose.heading == pytest.approx(start.heading)

    other = {"left": "right", "right": "left"}
    signs = {"steering": -1.0, "rudder": -1.0}
    right = {
        " ".join(other.get(word, word) for word in part.split()): value * signs.get(part, 1.0)
        for part, value in left.items()
    }
    turns: list[float] = []
    for outputs in (left, right):
        seen = _driven(kind, outputs, 0.5).inputs()
        turns.append(math.remainder(seen.pose.heading - start.heading, math.tau))
        assert seen.yaw_rate * turns[-1] > 0.0
    assert turns[0] > 0.05
    assert turns[1] == pytest.approx(-turns[0])

    seen = _driven(kind, {part: -value for part, value in ahead.items()}, 0.3).inputs()
    assert max(seen.speed, seen.travelled_m) < 0.0


def test_a_wall_stops_the_car_and_presses_the_bumper() -> None:
    """At a wall the car stops, decelerates hard, and can reverse away or be put back."""
    world = DrivingWorld({"wheels", "steering"}, _SIZE, seed=2)
    hardest = 0.0
    for _ in range(600):
        world.advance(0.01, {"wheels": 1.0})
        hardest = min(hardest, world.inputs().acceleration_x)
    seen = world.inputs()
    assert seen.bumped
    assert seen.speed == 0.0
    assert _clearance(seen.pose) == pytest.approx(RADIUS, abs=0.005)
    assert hardest < -20.0
    _run(world, {"wheels": 1.0}, 1.0)
    assert world.inputs().travelled_m == pytest.approx(seen.travelled_m, abs=1e-3)
    _run(world, {"wheels": -0.5}, 0.5)
    assert not world.inputs().bumped
    assert world.inputs().travelled_m < seen.travelled_m - 0.1
    travelled_m = world.inputs().travelled_m
    world.put_back()
    start = DrivingWorld({"wheels", "steering"}, _SIZE, seed=2).inputs().pose
    assert (world.inputs().pose, world.inputs().speed) == (start, 0.0)
    assert world.inputs().travelled_m == travelled_m


@given(
    seed=st.integers(0, 10_000),
    steps=st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 2), min_size=1, max_size=30),
)
def test_a_tank_does_not_pass_through_walls(seed: int, steps: list[tuple[float, float]]) -> None:
    world = DrivingWorld({"left track", "right track"}, _SIZE, seed)
    for left, right in steps:
        world.advance(0.2, {"left track": left, "right track": right})
        assert _clearance(world.inputs().pose) >= RADIUS - 1e-6


def test_mixed_parts_are_refused() -> None:
    with pytest.raises(RobotError, match="No vehicle has all of these parts: rudder, wheels"):
        DrivingWorld({"wheels", "rudder"}, _SIZE, seed=1)
