"""Registers of the simulated chips, checked against their data sheets."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast

import pytest

from shapechanger.contract.world import Pose, Readings, World
from shapechanger.robot.drivers.mpu6050 import SimulatedMpu6050

_READINGS = Readings(
    Pose(0.0, 0.0, 0.0),
    acceleration_x=9.80665,
    acceleration_y=-0.5 * 9.80665,
    yaw_rate=math.radians(100.0),
)


def _words(chip: SimulatedMpu6050) -> tuple[int, ...]:
    data = bytes(chip.read(0x3B, 14))
    return tuple(int.from_bytes(data[i : i + 2], "big", signed=True) for i in range(0, 14, 2))


@pytest.mark.parametrize(
    ("select", "per_g", "per_deg_per_s"),
    [(0, 16384, 131.0), (1, 8192, 65.5), (2, 4096, 32.8), (3, 2048, 16.4)],
)
def test_the_mpu6050_measures_in_each_range(select: int, per_g: int, per_deg_per_s: float) -> None:
    """Accelerometer and gyroscope scale with their ranges, register map sections 4.17 and 4.19."""
    chip = SimulatedMpu6050(cast("World", SimpleNamespace(inputs=lambda: _READINGS)))
    chip.write(0x6B, [0])  # Wake up.
    chip.write(0x1C, [select << 3])
    x, y, z, _, _, _, yaw = _words(chip)
    assert (x, y, z) == (per_g, -per_g // 2, per_g)
    assert yaw == 13100
    chip.write(0x1C, [0])
    chip.write(0x1B, [select << 3])
    assert _words(chip)[0] == 16384
    assert _words(chip)[6] == round(100.0 * per_deg_per_s)


def test_the_mpu6050_sleeps_at_power_on() -> None:
    """The chip reads 0 while asleep."""
    chip = SimulatedMpu6050(cast("World", SimpleNamespace(inputs=lambda: _READINGS)))
    assert _words(chip) == (0,) * 7
    chip.write(0x6B, [0])
    assert any(_words(chip))
