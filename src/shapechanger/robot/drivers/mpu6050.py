"""Inertial sensor MPU-6050 over I2C.

Registers: InvenSense, MPU-6000 and MPU-6050 register map and descriptions, RM-MPU-6000A, rev. 4.2.
It must be mounted with x forward, y left and z up.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Final

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import I2cDevice, I2cKeys, SensorChip, simulated_at_address
from shapechanger.robot.drivers.simulation import SimulatedChip
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # Only simulations need these.
    from shapechanger.contract.world import World

_CONFIG: Final = 0x1A
_GYRO_CONFIG: Final = 0x1B
_ACCEL_CONFIG: Final = 0x1C
_ACCEL_XOUT_H: Final = 0x3B
_MEASURED: Final = struct.Struct(">7h")  # Acceleration x y z, temperature, rate of turn x y z.
_PWR_MGMT_1: Final = 0x6B
_WHO_AM_I: Final = 0x75

_IDENTITY: Final = 0x68  # Identity of an MPU-6050, at both of its addresses.
_LOW_PASS_44_HZ: Final = 3  # CONFIG, DLPF_CFG.
_RANGE_500_DEG_PER_S: Final = 1 << 3  # GYRO_CONFIG, FS_SEL.
_RANGE_4_G: Final = 1 << 3  # ACCEL_CONFIG, AFS_SEL.
_AWAKE: Final = 1  # PWR_MGMT_1: awake, clock from the x gyroscope.

_STANDARD_GRAVITY: Final = 9.80665  # m/s2
_M_PER_S2: Final = _STANDARD_GRAVITY / 8192.0  # 8192 LSB/g at 4 g.
_RAD_PER_S: Final = math.radians(1.0) / 65.5  # 65.5 LSB/(deg/s) at 500 deg/s.

# A gyroscope at rest reads up to 20 deg/s (product specification PS-MPU-6000A, "ZRO tolerance"), so
# its zero is estimated by a slow filter while the robot is not propelled.
_MOST_ZERO_RAD_PER_S: Final = math.radians(25.0)
_ZERO_SHARE: Final = 0.02


class Mpu6050Keys(I2cKeys, frozen=True, kw_only=True):
    """Keys of an MPU-6050. x points forward, y left and z up."""

    address: Annotated[int, Meta(ge=0x68, le=0x69)] = 0x68


class Mpu6050(I2cDevice):
    """Inertial sensor; see `SensorDriver`."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        super().__init__(f"Sensor {plan.name!r}", Mpu6050Keys.of(plan.settings), hardware)
        self._zero_rad_per_s: float | None = None
        (identity,) = self.read_registers(_WHO_AM_I)
        if identity != _IDENTITY:
            raise RobotError(
                f"{self.name} is not an MPU-6050: it identifies itself as 0x{identity:02x}, "
                f"not 0x{_IDENTITY:02x}."
            )
        self.write_registers(_PWR_MGMT_1, _AWAKE)
        self.write_registers(_CONFIG, _LOW_PASS_44_HZ)
        self.write_registers(_GYRO_CONFIG, _RANGE_500_DEG_PER_S)
        self.write_registers(_ACCEL_CONFIG, _RANGE_4_G)

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return acceleration forward and left in m/s², and yaw rate to the left in rad/s.

        Gravity is part of the acceleration.
        """
        measured = self.read_registers(_ACCEL_XOUT_H, _MEASURED.size)
        x, y, z, _, _, _, yaw = _MEASURED.unpack(measured)
        if x == y == z == 0:  # An awake sensor would measure at least gravity.
            raise RobotError(f"{self.name} is asleep: it lost power for a moment.")
        rate = yaw * _RAD_PER_S
        if direction == 0.0 and abs(rate) < _MOST_ZERO_RAD_PER_S:
            zero = rate if self._zero_rad_per_s is None else self._zero_rad_per_s
            self._zero_rad_per_s = zero + (rate - zero) * _ZERO_SHARE
        return {
            "acceleration_x": x * _M_PER_S2,
            "acceleration_y": y * _M_PER_S2,
            "yaw_rate": rate - (self._zero_rad_per_s or 0.0),
        }


_SLEEP: Final = 0x40  # PWR_MGMT_1.
_LSB_PER_G: Final = (16384.0, 8192.0, 4096.0, 2048.0)  # Section 4.17.
_LSB_PER_DEG_PER_S: Final = (131.0, 65.5, 32.8, 16.4)  # Section 4.19.


class SimulatedMpu6050(SimulatedChip):
    """MPU-6050: acceleration and rate of turn, with x ahead, y to the left and z up."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._registers = bytearray(128)
        self._registers[_PWR_MGMT_1] = _SLEEP
        self._registers[_WHO_AM_I] = _IDENTITY

    def read(self, register: int, length: int) -> list[int]:
        """Read bytes, starting at a register."""
        if not self._registers[_PWR_MGMT_1] & _SLEEP:
            seen = self._world.inputs()
            per_g = _LSB_PER_G[self._registers[_ACCEL_CONFIG] >> 3 & 3]
            per_rate = _LSB_PER_DEG_PER_S[self._registers[_GYRO_CONFIG] >> 3 & 3]
            ahead, left = (
                a / _STANDARD_GRAVITY * per_g for a in (seen.acceleration_x, seen.acceleration_y)
            )
            yaw = math.degrees(seen.yaw_rate) * per_rate
            values = (ahead, left, per_g, 0.0, 0.0, 0.0, yaw)
            raw = [max(-32768, min(32767, round(value))) for value in values]
            _MEASURED.pack_into(self._registers, _ACCEL_XOUT_H, *raw)
        return [self._registers[(register + i) % 128] for i in range(length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes, starting at a register."""
        for at, byte in enumerate(data, register):
            if at % 128 != _WHO_AM_I:
                self._registers[at % 128] = byte


MPU6050: Final = SensorChip(
    measures="imu",
    keys=Mpu6050Keys,
    open=Mpu6050,
    simulate=simulated_at_address(SimulatedMpu6050),
)
