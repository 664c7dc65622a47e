"""Joint encoders on the twin's I2C bus."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.contract.plan import GuardPlan, SensorPlan
from shapechanger.contract.world import World
from shapechanger.errors import RobotError, UnknownName
from shapechanger.finger.anatomy import JOINTS
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import FingerWorld
from shapechanger.robot.drivers.as5600 import (
    ChannelsBehind,
    SimulatedAs5600,
    Tca9548a,
    connect_encoders,
    open_driver,
)
from shapechanger.robot.twin.room import DrivingWorld
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.in_process import LocalBoard

_TURN = 2.0 * math.pi


def _sensor(joints: tuple[str, ...] = JOINTS) -> SensorPlan:
    n = len(joints)
    settings = {
        "bus": 1,
        "mux": 0x70,
        "joints": list(joints),
        "channels": [7, 0, 3, 4][:n],
        "zeros": [4090, 5, 2048, 1000][:n],
        "directions": [1, -1, -1, 1][:n],
    }
    return SensorPlan("joints", "as5600", "joints", settings)  # pyright: ignore[reportArgumentType]


def _board(world: World, sensor: SensorPlan) -> LocalBoard:
    return LocalBoard(TwinWiring(GuardPlan("it", (), (), (sensor,))), world)


def test_readings_match_the_joint_angles() -> None:
    """Readings match the joint angles within half a count for any channel, zero and direction."""
    world = FingerWorld(NOMINAL, seed=2)
    driver = open_driver(_sensor(), _board(world, _sensor()).hardware)
    for seed in range(5):
        world.place(seed)
        truth = {name: v for name, v in world.truth().items() if name.endswith("/angle")}
        assert driver.read(0, 0.0) == pytest.approx(truth, abs=0.51 * _TURN / 4096)


def test_encoder_noise_follows_the_parameters_and_the_seed() -> None:
    """Noise has the configured standard deviation and is reproducible from the seed."""
    noisy = NOMINAL.replace(joint_noise=0.02)
    readings: list[list[float]] = []
    for _ in range(2):
        world = FingerWorld(noisy, seed=2)
        driver = open_driver(_sensor(), _board(world, _sensor()).hardware)
        readings.append([driver.read(0, 0.0)["PIP_flexion/angle"] for _ in range(400)])
    assert readings[0] == readings[1]
    assert np.std(readings[0]) == pytest.approx(0.02, rel=0.1)
    assert np.mean(readings[0]) == pytest.approx(world.truth()["PIP_flexion/angle"], abs=0.004)


def test_the_multiplexer_passes_open_channels_only() -> None:
    """No channel is open at first; with two open, a bit is low where either chip pulls it low."""
    chips = [SimulatedAs5600("knee", lambda: 0.0, counts, 1) for counts in (0x0F3, 0x155)]
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


@pytest.mark.parametrize(
    ("how", "seen"),
    [
        ("", (True, False, False)),
        ("gone", (False, True, False)),
        ("weak", (True, True, False)),
        ("strong", (True, False, True)),
    ],
)
def test_the_status_reports_the_magnet(how: str, seen: tuple[bool, ...]) -> None:
    """The status bits MD, ML and MH report a missing, weak or strong magnet."""
    board = _board(FingerWorld(NOMINAL, seed=0), _sensor())
    sensor = connect_encoders(_sensor(), board.hardware)
    board.pins.encoder("PIP_flexion").set_magnet(how)  # pyright: ignore[reportArgumentType]
    readings = sensor.measure(sensor.encoders[2])
    assert (readings.detects_magnet, readings.too_weak, readings.too_strong) == seen


def test_unknown_joints_are_refused() -> None:
    """Unknown joints and faults raise; in a world without joints, encoders read 0."""
    with pytest.raises(RobotError, match="and no knee"):
        _board(FingerWorld(NOMINAL, seed=0), _sensor(("knee",)))
    board = _board(DrivingWorld(frozenset(), (160, 120), 0), _sensor(("knee", "ankle")))
    with pytest.raises(UnknownName, match=r"'kneee'\. Did you mean 'knee'"):
        board.pins.encoder("kneee")
    with pytest.raises(UnknownName, match="fault of a magnet"):
        board.pins.encoder("knee").set_magnet("gonee")  # pyright: ignore[reportArgumentType]
    driver = open_driver(_sensor(("knee", "ankle")), board.hardware)
    assert driver.read(0, 0.0) == {"knee/angle": 0.0, "ankle/angle": 0.0}
