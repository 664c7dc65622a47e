"""Magnetic encoders AS5600 at joints, behind a multiplexer TCA9548A, over I2C.

All AS5600 have one address, so each joint's has a channel of the multiplexer. Registers: ams,
AS5600 data sheet v1-06, 2018-06-20, figures 21 to 23. Multiplexer: Texas Instruments, TCA9548A data
sheet SCPS207F, section 8.5.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.errors import device_errors
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware, I2cBus

ADDRESS: Final = 0x36
"""Of every AS5600."""

COUNTS_PER_TURN: Final = 4096

_STATUS: Final = 0x0B  # RAW ANGLE follows it, high byte first: one transfer gives all three.
_MAGNET_DETECTED: Final = 0x20
_TOO_WEAK: Final = 0x10
_TOO_STRONG: Final = 0x08

# Consecutive missed readings of a joint before the sensor fails, as for a servo on the servo bus:
# 50 ms of a guard's ticks. Chosen so that one disturbed transfer does not release a finger.
_MOST_MISSED: Final = 5


@dataclass(frozen=True, slots=True)
class JointEncoder:
    """Encoder of one joint.

    Attributes:
        joint: Name of the joint.
        channel: Channel of the multiplexer, 0 to 7.
        zero: Counts with a straight joint, 0 to 4095.
        direction: 1 if the counts rise with the angle, -1 if they fall.
    """

    joint: str
    channel: int
    zero: int
    direction: int

    def angle(self, counts: int) -> float:
        """Convert counts to an angle, rad, within half a turn of the zero."""
        half = COUNTS_PER_TURN // 2
        turned = (counts - self.zero + half) % COUNTS_PER_TURN - half
        return self.direction * turned * 2.0 * math.pi / COUNTS_PER_TURN


@dataclass(frozen=True, slots=True)
class Measured:
    """Reading of an encoder.

    Attributes:
        counts: Raw angle, 0 to 4095.
        detects_magnet: Whether there is a magnet; without one the counts are meaningless.
        too_weak: Whether the magnet is too far away.
        too_strong: Whether it is too near.
    """

    counts: int
    detects_magnet: bool
    too_weak: bool
    too_strong: bool


class As5600:
    """Encoders of several joints; see `SensorDriver`.

    Args:
        bus: The I2C bus.
        mux: Address of the multiplexer.
        encoders: One encoder per joint.
        words: Description of the multiplexer for messages.

    Attributes:
        encoders: One encoder per joint.
    """

    def __init__(
        self, bus: I2cBus, mux: int, encoders: tuple[JointEncoder, ...], words: str
    ) -> None:
        self._bus = bus
        self._mux = mux
        self._words = words
        self._missed = dict.fromkeys((one.joint for one in encoders), 0)
        self.encoders = encoders

    def measure(self, encoder: JointEncoder) -> Measured:
        """Read one encoder.

        Raises:
            RobotError: If it or the multiplexer does not respond.
        """
        with device_errors(self._words):
            self._bus.write_byte(self._mux, 1 << encoder.channel)
        with device_errors(f"The encoder of {encoder.joint}, on channel {encoder.channel},"):
            status, high, low = self._bus.read_i2c_block_data(ADDRESS, _STATUS, 3)
        return Measured(
            counts=(high << 8 | low) % COUNTS_PER_TURN,
            detects_magnet=bool(status & _MAGNET_DETECTED),
            too_weak=bool(status & _TOO_WEAK),
            too_strong=bool(status & _TOO_STRONG),
        )

    def counts(self, encoder: JointEncoder) -> int:
        """Return the raw angle of one encoder, 0 to 4095.

        Raises:
            RobotError: If it or the multiplexer does not respond, or it detects no magnet.
        """
        measured = self.measure(encoder)
        if not measured.detects_magnet:
            raise RobotError(
                f"The encoder of {encoder.joint}, on channel {encoder.channel}, detects no magnet."
            )
        return measured.counts

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return each joint's angle, such as `MCP_flexion/angle`, rad, -pi to pi around its zero.

        Joints without a reading are omitted.

        Raises:
            RobotError: If a joint was missing in several consecutive readings.
        """
        said: dict[str, float] = {}
        failures: dict[str, None] = {}  # A missing multiplexer is reported once.
        for encoder in self.encoders:
            try:
                counts = self.counts(encoder)
            except RobotError as error:
                self._missed[encoder.joint] += 1
                if self._missed[encoder.joint] >= _MOST_MISSED:
                    failures[str(error)] = None
                continue
            self._missed[encoder.joint] = 0
            said[f"{encoder.joint}/angle"] = encoder.angle(counts)
        if failures:
            raise RobotError(" ".join(failures))
        return said

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()


def connect_encoders(plan: SensorPlan, hardware: Hardware) -> As5600:
    """Return the encoders without reading them.

    Args:
        plan: Has the settings `bus` and `mux`, and name, channel, zero and direction of each joint
            in `joints`, `channels`, `zeros` and `directions`.
        hardware: Where the bus is.

    Raises:
        RobotError: If there is no such bus.
    """
    bus, mux = plan.settings["bus"], plan.settings["mux"]
    columns = (plan.settings[key] for key in ("joints", "channels", "zeros", "directions"))
    rows = zip(*columns, strict=True)
    encoders = tuple(JointEncoder(*row) for row in rows)
    words = f"The multiplexer of sensor {plan.name!r} at 0x{mux:02x} on I2C bus {bus}"
    with device_errors(words):
        return As5600(hardware.i2c(bus), mux, encoders, words)


def open_driver(plan: SensorPlan, hardware: Hardware) -> As5600:
    """Open the sensor and read each encoder once; see `connect_encoders`.

    Args:
        plan: The sensor.
        hardware: Hardware of its bus.
    """
    sensor = connect_encoders(plan, hardware)
    try:
        for encoder in sensor.encoders:
            sensor.counts(encoder)
    except BaseException:
        sensor.close()
        raise
    return sensor
