"""The MPU-6050: acceleration and rate of turn.

Source: InvenSense, MPU-6000 and MPU-6050 register map and descriptions, rev. 4.2, 2013.
Its axes are the vehicle's: x ahead, y to the left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

from shapechanger.worlds.world import Readings

__all__ = ["Mpu6050"]

_GYRO_CONFIG: Final = 0x1B
_ACCEL_CONFIG: Final = 0x1C
_ACCEL_XOUT_H: Final = 0x3B
_GYRO_ZOUT_L: Final = 0x48
_PWR_MGMT_1: Final = 0x6B
_WHO_AM_I: Final = 0x75
_RESET: Final = 0x80
_SLEEP: Final = 0x40

_STANDARD_GRAVITY: Final = 9.80665  # m/s2
_LSB_PER_G: Final = (16384.0, 8192.0, 4096.0, 2048.0)  # Section 4.17.
_LSB_PER_DEG_PER_S: Final = (131.0, 65.5, 32.8, 16.4)  # Section 4.19.
_ROOM_TEMPERATURE: Final = round((22.0 - 36.53) * 340.0)  # Section 4.18.


class Mpu6050:
    """Registers that are answered from the world.

    Args:
        readings: What the world shows now.
    """

    def __init__(self, readings: Callable[[], Readings]) -> None:
        self._readings = readings
        self._registers = bytearray(128)
        self._wake_up()

    def read(self, register: int, length: int) -> list[int]:
        """Bytes, from a register on."""
        if register <= _GYRO_ZOUT_L and register + length > _ACCEL_XOUT_H:
            self._measure()
        return [self._registers[(register + i) % 128] for i in range(length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes, from a register on."""
        for i, byte in enumerate(data):
            at = (register + i) % 128
            if at == _PWR_MGMT_1 and byte & _RESET:
                self._wake_up()
            elif at != _WHO_AM_I:
                self._registers[at] = byte

    def _wake_up(self) -> None:
        self._registers[:] = bytes(128)
        self._registers[_PWR_MGMT_1] = _SLEEP
        self._registers[_WHO_AM_I] = 0x68

    def _measure(self) -> None:
        if self._registers[_PWR_MGMT_1] & _SLEEP:
            return
        seen = self._readings()
        per_g = _LSB_PER_G[self._registers[_ACCEL_CONFIG] >> 3 & 3]
        per_rate = _LSB_PER_DEG_PER_S[self._registers[_GYRO_CONFIG] >> 3 & 3]
        values = (
            seen.acceleration_x / _STANDARD_GRAVITY * per_g,
            seen.acceleration_y / _STANDARD_GRAVITY * per_g,
            per_g,
            _ROOM_TEMPERATURE,
            0.0,
            0.0,
            math.degrees(seen.yaw_rate) * per_rate,
        )
        data = b"".join(_word(value) for value in values)
        self._registers[_ACCEL_XOUT_H : _ACCEL_XOUT_H + len(data)] = data


def _word(value: float) -> bytes:
    return max(-32768, min(32767, round(value))).to_bytes(2, "big", signed=True)
