"""Joint encoders on the twin's I2C bus."""

import math

import pytest

from shapechanger.contract.plan import GuardPlan, SensorPlan
from shapechanger.contract.world import World
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import FingerWorld
from shapechanger.robot.drivers.as5600 import open_and_read
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.in_process import LocalBoard

_TURN = 2.0 * math.pi


def _sensor(joints: tuple[str, ...] = JOINTS) -> SensorPlan:
    keys = [(7, 4090, 1), (0, 5, -1), (3, 2048, -1), (4, 1000, 1)]
    rows = {
        name: {"channel": channel, "zero": zero, "direction": direction}
        for name, (channel, zero, direction) in zip(joints, keys, strict=False)
    }
    return SensorPlan("joints", "as5600", "joints", {"bus": 1, "mux": 0x70, "rows": rows})


def _board(world: World, sensor: SensorPlan) -> LocalBoard:
    return LocalBoard(TwinWiring(GuardPlan("it", (), (), (sensor,))), world)


def test_readings_match_the_joint_angles() -> None:
    world = FingerWorld(NOMINAL, seed=2)
    driver = open_and_read(_sensor(), _board(world, _sensor()).hardware)
    for seed in range(5):
        world.place(seed)
        truth = {name: v for name, v in world.truth().items() if name.endswith("/angle")}
        assert driver.read(0, 0.0) == pytest.approx(truth, abs=0.51 * _TURN / 4096)
