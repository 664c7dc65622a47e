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
from shapechanger.robot.drivers.settings import in_words, texts, whole, wholes
from shapechanger.robot.guard.plan import SensorPlan
from shapechanger.robot.hardware import Hardware, I2cBus

__all__ = [
    "ADDRESS",
    "COUNTS_PER_TURN",
    "As5600",
    "JointEncoder",
    "Measured",
    "connect_encoders",
    "open_driver",
]

ADDRESS: Final = 0x36
"""Of every AS5600."""

COUNTS_PER_TURN: Final = 4096

_STATUS: Final = 0x0B  # RAW ANGLE follows it, high byte first: one transfer gives all three.
_MAGNET_DETECTED: Final = 0x20
_TOO_WEAK: Final = 0x10
_TOO_STRONG: Final = 0x08

# So many readings in a row a joint may be missing until the sensor fails, as for a servo on the
# servo bus: 50 ms of a guard's ticks. Chosen: one disturbed transfer must not drop a finger.
_MOST_MISSED: Final = 5


@dataclass(frozen=True, slots=True)
class JointEncoder:
    """The encoder of one joint.

    Attributes:
        joint: Name of the joint.
        channel: Of the multiplexer, 0 to 7.
        zero: Counts while the joint is straight, 0 to 4095.
        direction: 1 if the counts rise with the angle, -1 if they fall.
    """

    joint: str
    channel: int
    zero: int
    direction: int

    def angle(self, counts: int) -> float:
        """The angle for some counts, rad, within half a turn around the zero."""
        half = COUNTS_PER_TURN // 2
        turned = (counts - self.zero + half) % COUNTS_PER_TURN - half
        return self.direction * turned * 2.0 * math.pi / COUNTS_PER_TURN


@dataclass(frozen=True, slots=True)
class Measured:
    """What an encoder says.

    Attributes:
        counts: Its raw angle, 0 to 4095.
        detects_magnet: Whether there is a magnet; the counts mean nothing without.
        too_weak: Whether the magnet is too far away.
        too_strong: Whether it is too near.
    """

    counts: int
    detects_magnet: bool
    too_weak: bool
    too_strong: bool


class As5600:
    """The encoders of some joints; see `SensorDriver`.

    Args:
        bus: The I2C bus.
        mux: Address of the multiplexer.
        encoders: One for each joint.
        words: What the multiplexer is called in a sentence.

    Attributes:
        encoders: One for each joint.
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
        """Ask one encoder.

        Raises:
            RobotError: If it or the multiplexer does not answer.
        """
        with in_words(self._words):
            self._bus.write_byte(self._mux, 1 << encoder.channel)
        with in_words(f"The encoder of {encoder.joint}, on channel {encoder.channel},"):
            status, high, low = self._bus.read_i2c_block_data(ADDRESS, _STATUS, 3)
        return Measured(
            counts=(high << 8 | low) % COUNTS_PER_TURN,
            detects_magnet=bool(status & _MAGNET_DETECTED),
            too_weak=bool(status & _TOO_WEAK),
            too_strong=bool(status & _TOO_STRONG),
        )

    def counts(self, encoder: JointEncoder) -> int:
        """The raw angle of one encoder, 0 to 4095.

        Raises:
            RobotError: If it or the multiplexer does not answer, or it detects no magnet.
        """
        measured = self.measure(encoder)
        if not measured.detects_magnet:
            raise RobotError(
                f"The encoder of {encoder.joint}, on channel {encoder.channel}, detects no magnet."
            )
        return measured.counts

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """The angle of each joint, such as `MCP_flexion/angle`, rad, -pi to pi around its zero.

        A joint that is missing now is left out.

        Raises:
            RobotError: If a joint was missing in several readings in a row, and why.
        """
        said: dict[str, float] = {}
        failures: dict[str, None] = {}  # A multiplexer that is gone is said once.
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
        """Let go of the bus."""
        self._bus.close()


def connect_encoders(plan: SensorPlan, hardware: Hardware) -> As5600:
    """The encoders, of which none has been asked yet.

    Args:
        plan: Its settings are `bus`, `mux`, and of each joint its name, channel, zero and direction
            in `joints`, `channels`, `zeros` and `directions`.
        hardware: Where the bus is.

    Raises:
        RobotError: If there is no such bus.
    """
    bus, mux = whole(plan.settings, "bus"), whole(plan.settings, "mux")
    columns = (wholes(plan.settings, key) for key in ("channels", "zeros", "directions"))
    rows = zip(texts(plan.settings, "joints"), *columns, strict=True)
    encoders = tuple(JointEncoder(*row) for row in rows)
    words = f"The multiplexer of sensor {plan.name!r} at 0x{mux:02x} on I2C bus {bus}"
    with in_words(words):
        return As5600(hardware.i2c(bus), mux, encoders, words)


def open_driver(plan: SensorPlan, hardware: Hardware) -> As5600:
    """Open the sensor, and ask each encoder once; see `connect_encoders`."""
    sensor = connect_encoders(plan, hardware)
    try:
        for encoder in sensor.encoders:
            sensor.counts(encoder)
    except BaseException:
        sensor.close()
        raise
    return sensor
