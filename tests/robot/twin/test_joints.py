"""Joint encoders on the twin's I2C bus."""

import math

import pytest

from shapechanger.contract.plan import GuardPlan, SensorPlan
from shapechanger.contract.world import World
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import FingerWorld
from shapechanger.robot.drivers.as5600 import (
    As5600,
    ChannelsBehind,
    JointKeys,
    SimulatedAs5600,
    Tca9548a,
    open_and_read,
)
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


def test_the_multiplexer_passes_open_channels_only() -> None:
    """No channel is open at first; with two open, a bit is low where either chip pulls it low."""
    keys = [JointKeys(channel=0, zero=counts) for counts in (0x0F3, 0x155)]
    chips = [SimulatedAs5600(one, lambda: 0.0) for one in keys]
    mux = Tca9548a({0: chips[0], 6: chips[1]})
    behind = ChannelsBehind(mux)
    with pytest.raises(OSError, match="no chip answers"):
        behind.read(0x0C, 2)
    mux.write(1 << 6, [])
    assert behind.read(0x0C, 2) == [0x01, 0x55]
    mux.write(0x55, [1])  # The last byte counts.
    assert behind.read(0x0B, 3) == [0x20, 0x00, 0xF3]
    mux.write(0x41, [])
    assert behind.read(0x0C, 2) == [0x00, 0x51]
    mux.write(0x08, [])
    with pytest.raises(OSError, match="no chip answers"):
        behind.read(0x0C, 2)


@pytest.mark.parametrize("how", ["", "gone", "weak", "strong"])
def test_the_status_reports_the_magnet(how: str) -> None:
    board = _board(FingerWorld(NOMINAL, seed=0), _sensor())
    sensor = As5600(_sensor(), board.hardware)
    board.pins.encoder("PIP_flexion").set_magnet(how)
    assert sensor.measure("PIP_flexion")[1] == how
