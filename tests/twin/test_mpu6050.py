"""Ranges of the simulated MPU-6050, against the tables of its register map."""

from __future__ import annotations

import math
import struct

import pytest

from shapechanger.twin.chips import SimulatedMpu6050
from shapechanger.worlds.world import Pose, Readings

# RM-MPU-6000A, sections 4.17 and 4.19: counts per g and per degree per second.
_ACCELERATION = [(0, 16384.0), (1, 8192.0), (2, 4096.0), (3, 2048.0)]
_RATE = [(0, 131.0), (1, 65.5), (2, 32.8), (3, 16.4)]


def _measured(accel_range: int, gyro_range: int) -> tuple[int, ...]:
    """Return the seven words of a chip at 0.5 g forward and 10 degrees per second."""
    readings = Readings(
        Pose(0.0, 0.0, 0.0), acceleration_x=0.5 * 9.80665, yaw_rate=math.radians(10.0)
    )
    chip = SimulatedMpu6050(lambda: readings)
    chip.write(0x6B, [1])
    chip.write(0x1B, [gyro_range << 3])
    chip.write(0x1C, [accel_range << 3])
    return struct.unpack(">7h", bytes(chip.read(0x3B, 14)))


@pytest.mark.parametrize(("setting", "counts_per_g"), _ACCELERATION)
def test_acceleration_range(setting: int, counts_per_g: float) -> None:
    """Each AFS_SEL has its own scale."""
    x, _, z, *_ = _measured(setting, 0)
    assert (x, z) == (round(0.5 * counts_per_g), round(counts_per_g))


@pytest.mark.parametrize(("setting", "counts_per_deg_per_s"), _RATE)
def test_rate_range(setting: int, counts_per_deg_per_s: float) -> None:
    """Each FS_SEL has its own scale."""
    assert _measured(1, setting)[-1] == round(10.0 * counts_per_deg_per_s)
