"""Chips on the board's I2C buses, register by register.

Each class names the data sheet from which its registers and numbers come.
"""

from __future__ import annotations

import errno
import math
import struct
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, Literal, Protocol, runtime_checkable

from shapechanger.contract.world import Readings, World
from shapechanger.errors import UnknownName
from shapechanger.robot.guard.plan import GuardPlan, SensorPlan
from shapechanger.robot.twin.signals import Pulse


class Chip(Protocol):
    """A chip at one address of an I2C bus."""

    def read(self, register: int, length: int) -> list[int]:
        """Read bytes.

        Args:
            register: Register of the first byte.
            length: Number of bytes.
        """
        ...

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes.

        Args:
            register: Register of the first byte.
            data: The bytes.
        """
        ...


@runtime_checkable
class JointWorld(Protocol):
    """A world with joints that encoders measure."""

    def measured_angle(self, joint: str) -> float:
        """Return one reading of a joint's angle, rad, with the noise of its encoder.

        Raises:
            RobotError: If there is no such joint.
        """
        ...


Magnet = Literal["", "gone", "weak", "strong"]
"""State of the magnet: in order (""), missing, too weak or too strong."""

_STATUS: Final = 0x0B
_RAW_ANGLE: Final = 0x0C
_DETECTED: Final = 0x20
_STATUS_OF: Final = {"": _DETECTED, "gone": 0x10, "weak": _DETECTED | 0x10, "strong": 0x28}
_COUNTS_PER_TURN: Final = 4096


class SimulatedAs5600:
    """AS5600: magnetic encoder of a joint.

    Source: ams, AS5600 data sheet v1-06, 2018-06-20, figures 21 to 23 and "I2C Modes".

    Args:
        joint: Name of the joint on which the magnet sits.
        angle: Reads the measured angle, rad.
        zero: Counts at the angle 0.
        direction: 1 if the counts rise with the angle, -1 if they fall.

    Attributes:
        joint: Name of the joint.
    """

    def __init__(self, joint: str, angle: Callable[[], float], zero: int, direction: int) -> None:
        self.joint = joint
        self._angle = angle
        self._zero = zero
        self._direction = direction
        self._magnet = ""

    def set_magnet(self, state: Magnet | str) -> None:
        """Set the state of the magnet.

        Raises:
            UnknownName: If there is no such state.
        """
        if state not in _STATUS_OF:
            raise UnknownName("fault of a magnet", state, _STATUS_OF)
        self._magnet = state

    def read(self, register: int, length: int) -> list[int]:
        """Read bytes, starting at a register; those that no driver reads are 0."""
        high, low = divmod(self._counts(), 256)
        known = {_STATUS: _STATUS_OF[self._magnet], _RAW_ANGLE: high, _RAW_ANGLE + 1: low}
        return [known.get(register + i, 0) for i in range(length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Do nothing: the settings are not simulated, and no driver writes them."""

    def _counts(self) -> int:
        if self._magnet == "gone":
            return 0
        turned = self._direction * self._angle() / (2.0 * math.pi)
        return (self._zero + round(turned * _COUNTS_PER_TURN)) % _COUNTS_PER_TURN


_CONFIGURATION: Final = 0
_BUS_VOLTAGE: Final = 2
_RESET: Final = 0x8000
_AT_POWER_ON: Final = 0x399F
_BUS_LSB_V: Final = 4e-3
_CONVERSION_READY: Final = 0x2


class SimulatedIna219:
    """INA219: voltage of the battery, in registers of 16 bits; the current is not simulated.

    Source: Texas Instruments, INA219 data sheet SBOS448G, section 8.6.

    Args:
        readings: Reads the state of the world.
    """

    def __init__(self, readings: Callable[[], Readings]) -> None:
        self._readings = readings
        self._configuration = _AT_POWER_ON

    def read(self, register: int, length: int) -> list[int]:
        """Read one register; its two bytes repeat."""
        word = self._configuration if register == _CONFIGURATION else 0
        if register == _BUS_VOLTAGE:
            steps = round(self._readings().battery_v / _BUS_LSB_V)
            word = min(steps, 0x1FFF) << 3 | _CONVERSION_READY
        return [word >> 8 if i % 2 == 0 else word & 0xFF for i in range(length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write the configuration; the chip accepts only whole registers."""
        if register == _CONFIGURATION and len(data) == 2:
            word = data[0] << 8 | data[1]
            self._configuration = _AT_POWER_ON if word & _RESET else word


_GYRO_CONFIG: Final = 0x1B
_ACCEL_CONFIG: Final = 0x1C
_ACCEL_XOUT_H: Final = 0x3B
_GYRO_ZOUT_L: Final = 0x48
_MEASURED: Final = struct.Struct(">7h")  # Acceleration, temperature, rate of turn.
_PWR_MGMT_1: Final = 0x6B
_WHO_AM_I: Final = 0x75
_MPU6050_RESET: Final = 0x80
_SLEEP: Final = 0x40

_STANDARD_GRAVITY: Final = 9.80665  # m/s2
_LSB_PER_G: Final = (16384.0, 8192.0, 4096.0, 2048.0)  # Section 4.17.
_LSB_PER_DEG_PER_S: Final = (131.0, 65.5, 32.8, 16.4)  # Section 4.19.
_ROOM_TEMPERATURE: Final = round((22.0 - 36.53) * 340.0)  # Section 4.18.


class SimulatedMpu6050:
    """MPU-6050: acceleration and rate of turn, with x ahead, y to the left and z up.

    Source: InvenSense, MPU-6000 and MPU-6050 register map and descriptions, rev. 4.2, 2013.

    Args:
        readings: Reads the state of the world.
    """

    def __init__(self, readings: Callable[[], Readings]) -> None:
        self._readings = readings
        self._registers = bytearray(128)
        self._wake_up()

    def read(self, register: int, length: int) -> list[int]:
        """Read bytes, starting at a register."""
        if register <= _GYRO_ZOUT_L and register + length > _ACCEL_XOUT_H:
            self._measure()
        return [self._registers[(register + i) % 128] for i in range(length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes, starting at a register."""
        for i, byte in enumerate(data):
            at = (register + i) % 128
            if at == _PWR_MGMT_1 and byte & _MPU6050_RESET:
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
        words = [max(-32768, min(32767, round(value))) for value in values]
        _MEASURED.pack_into(self._registers, _ACCEL_XOUT_H, *words)


_OSCILLATOR_HZ: Final = 25e6  # Section 7.3.5.
_COUNTS: Final = 4096  # Per period, section 7.3.3.
_CHANNELS: Final = 16

_MODE1: Final = 0x00
_FIRST_LED: Final = 0x06
_LAST_LED: Final = 0x45
_FIRST_ALL_LED: Final = 0xFA
_LAST_ALL_LED: Final = 0xFD
_PRESCALE: Final = 0xFE
_MIN_PRESCALE: Final = 3

_RESTART: Final = 0x80
_AUTO_INCREMENT: Final = 0x20
_PCA9685_SLEEP: Final = 0x10
_FULL: Final = 0x10  # Bit 4 of ON_H and OFF_H: always on, always off. Off wins.


class SimulatedPca9685:
    """PCA9685: 16 PWM channels, which continue when the process that set them has ended.

    Source: NXP, PCA9685 product data sheet, rev. 4, 16 April 2015; comments name its sections.
    """

    def __init__(self) -> None:
        self._registers = bytearray(256)
        # Section 7.3, table 4: after power-on it sleeps, with all channels fully off.
        self._registers[_MODE1] = 0x11
        self._registers[0x01] = 0x04
        self._registers[0x02:0x06] = bytes((0xE2, 0xE4, 0xE8, 0xE0))
        for channel in range(_CHANNELS):
            self._registers[_FIRST_LED + 4 * channel + 3] = _FULL
        self._registers[_PRESCALE] = 0x1E
        self._halted: set[int] = set()  # Channels that wait for RESTART after a sleep.

    @property
    def channels(self) -> list[Pulse]:
        """Pulses of all channels; 0 us for a channel that is off."""
        period_s = _COUNTS * (self._registers[_PRESCALE] + 1) / _OSCILLATOR_HZ
        hz = 1.0 / period_s
        return [
            Pulse(self._counts(channel) / _COUNTS * period_s * 1e6, hz)
            for channel in range(_CHANNELS)
        ]

    def read(self, register: int, length: int) -> list[int]:
        """Read bytes, starting at a register; without auto-increment all of that register."""
        return [self._registers[at] for at in self._addressed(register, length)]

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write bytes, starting at a register."""
        # Auto-increment is as MODE1 had it when the transfer began.
        for at, byte in zip(self._addressed(register, len(data)), data, strict=True):
            self._write_byte(at, byte)

    def _addressed(self, register: int, length: int) -> list[int]:
        if self._registers[_MODE1] & _AUTO_INCREMENT:
            return [(register + i) % 256 for i in range(length)]
        return [register] * length

    def _write_byte(self, at: int, byte: int) -> None:
        if at == _MODE1:
            self._write_mode1(byte)
        elif at == _PRESCALE:
            if self._registers[_MODE1] & _PCA9685_SLEEP:  # Section 7.3.5: only while it sleeps.
                self._registers[at] = max(byte, _MIN_PRESCALE)
        elif _FIRST_ALL_LED <= at <= _LAST_ALL_LED:
            for channel in range(_CHANNELS):
                self._registers[_FIRST_LED + 4 * channel + at - _FIRST_ALL_LED] = byte
            self._halted.clear()
        else:
            self._registers[at] = byte
            if _FIRST_LED <= at <= _LAST_LED:
                self._halted.discard((at - _FIRST_LED) // 4)

    def _write_mode1(self, byte: int) -> None:
        before = self._registers[_MODE1]
        after = byte & ~_RESTART
        if byte & _PCA9685_SLEEP and not before & _PCA9685_SLEEP:
            # Section 7.3.1.1: channels that were on stop until RESTART is written as 1.
            self._halted = {c for c in range(_CHANNELS) if self._counts(c)}
        if byte & _RESTART and not byte & _PCA9685_SLEEP:
            self._halted.clear()
        if self._halted:
            after |= _RESTART
        self._registers[_MODE1] = after

    def _counts(self, channel: int) -> int:
        """Return for how many counts of a period a channel is on."""
        if self._registers[_MODE1] & _PCA9685_SLEEP or channel in self._halted:
            return 0
        at = _FIRST_LED + 4 * channel
        on_low, on_high, off_low, off_high = self._registers[at : at + 4]
        if off_high & _FULL:
            return 0
        if on_high & _FULL:
            return _COUNTS
        on = (on_high & 0x0F) << 8 | on_low
        off = (off_high & 0x0F) << 8 | off_low
        return (off - on) % _COUNTS


class Tca9548a:
    """TCA9548A: multiplexer of one I2C bus to eight; all are closed at power-on.

    Source: Texas Instruments, TCA9548A data sheet SCPS207F, section 8.5.4.

    Args:
        channels: Chip behind each channel, 0 to 7; all chips have the same address.
    """

    def __init__(self, channels: Mapping[int, Chip]) -> None:
        self.channels = dict(channels)
        self._control = 0

    @property
    def open(self) -> list[Chip]:
        """Chips behind the open channels."""
        return [chip for channel, chip in self.channels.items() if self._control >> channel & 1]

    def read(self, register: int, length: int) -> list[int]:
        """Read the control register; sending the register byte writes it first."""
        self._control = register
        return [self._control] * length

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write the control register; of all bytes, the register byte included, the last counts."""
        self._control = (register, *data)[-1]


class ChannelsBehind:
    """The chips behind a multiplexer, at their common address.

    Args:
        mux: The multiplexer.
    """

    def __init__(self, mux: Tca9548a) -> None:
        self._mux = mux

    def read(self, register: int, length: int) -> list[int]:
        """Read all chips behind open channels: a bit that one of them pulls low is low.

        Raises:
            OSError: If no channel is open, with the `errno` of the kernel's driver.
        """
        data = [0xFF] * length
        for chip in self._open_chips():
            data = [a & b for a, b in zip(data, chip.read(register, length), strict=True)]
        return data

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write to all chips behind open channels.

        Raises:
            OSError: If no channel is open.
        """
        for chip in self._open_chips():
            chip.write(register, data)

    def _open_chips(self) -> list[Chip]:
        if not (chips := self._mux.open):
            raise OSError(errno.EREMOTEIO, "no chip answers")
        return chips


_AS5600: Final = 0x36


def _joint_chips(plan: SensorPlan, world: World) -> dict[tuple[int, int], Chip]:
    """Return a multiplexer and the encoders behind it, by bus and address.

    Args:
        plan: Encoders of joints.
        world: World with these joints; in a world without joints all stand at zero.

    Raises:
        RobotError: If the world has other joints.
    """
    measured = world.measured_angle if isinstance(world, JointWorld) else _at_zero
    columns = (plan.settings[key] for key in ("channels", "zeros", "directions"))
    behind: dict[int, Chip] = {}
    for joint, *row in zip(plan.settings["joints"], *columns, strict=True):
        measured(joint)  # Raises for an unknown joint.
        channel, zero, direction = row
        behind[channel] = SimulatedAs5600(joint, partial(measured, joint), zero, direction)
    bus, mux = plan.settings["bus"], Tca9548a(behind)
    return {(bus, plan.settings["mux"]): mux, (bus, _AS5600): ChannelsBehind(mux)}


def _at_zero(joint: str) -> float:
    return 0.0


def chips_of(plan: GuardPlan, world: World) -> dict[tuple[int, int], Chip]:
    """Return the chips of a robot, by bus and address.

    Args:
        plan: The robot as it is wired.
        world: What the chips measure.

    Raises:
        RobotError: If the world has other joints than the robot.
    """
    readings = world.inputs
    chips: dict[tuple[int, int], Chip] = {}
    for output in plan.outputs:
        if output.settings.get("over") == "pca9685":
            at = output.settings["bus"], output.settings["address"]
            chips.setdefault(at, SimulatedPca9685())
    for sensor in plan.sensors:
        if sensor.driver in ("mpu6050", "ina219"):
            at = sensor.settings["bus"], sensor.settings["address"]
            chips[at] = (
                SimulatedMpu6050(readings)
                if sensor.driver == "mpu6050"
                else SimulatedIna219(readings)
            )
        elif sensor.driver == "as5600":
            chips |= _joint_chips(sensor, world)
    return chips
