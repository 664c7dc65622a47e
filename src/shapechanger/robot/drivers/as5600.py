"""Magnetic encoders AS5600 at joints, behind a multiplexer TCA9548A, over I2C.

All AS5600 have the same address, so each encoder has a channel of the multiplexer. Registers: ams,
AS5600 data sheet v1-06, 2018-06-20, figures 21 to 23. Multiplexer: Texas Instruments, TCA9548A data
sheet SCPS207F, section 8.5.4.
"""

from __future__ import annotations

import errno
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING, Annotated, Final, Literal

from msgspec import Meta

from shapechanger.contract.plan import SensorPlan
from shapechanger.errors import RobotError, require_known
from shapechanger.robot.drivers import chip
from shapechanger.robot.drivers.simulation import SimulatedChip, SimulatedSensor
from shapechanger.robot.hardware import Hardware

if TYPE_CHECKING:  # The guard must not load these modules.
    from shapechanger.contract.world import World
    from shapechanger.layout import Feature

ADDRESS: Final = 0x36
"""Address of every AS5600."""

COUNTS_PER_TURN: Final = 4096

_STATUS: Final = 0x0B  # RAW ANGLE follows, high byte first: one transfer reads all three bytes.
_MAGNET_DETECTED: Final = 0x20
_TOO_WEAK: Final = 0x10
_TOO_STRONG: Final = 0x08

# Consecutive missed readings of a joint at which the sensor fails, as for a servo on its bus:
# 50 ms of a guard's ticks. Chosen so that one disturbed transfer does not release a finger.
_MOST_MISSED: Final = 5


class JointKeys(chip.Keys, frozen=True, kw_only=True):
    """Keys of one joint, which has its own table.

    Attributes:
        channel: Channel of the multiplexer.
        zero: Counts of 1/4096 turn with a straight joint.
        direction: 1 if the counts rise with the angle, -1 if they fall.
    """

    channel: Annotated[int, Meta(ge=0, le=7)]
    zero: Annotated[int, Meta(ge=0, le=4095)] = 0
    direction: Literal[1, -1] = 1

    def angle(self, counts: int) -> float:
        """Convert counts to an angle, rad, within half a turn of the zero."""
        half = COUNTS_PER_TURN // 2
        turned = (counts - self.zero + half) % COUNTS_PER_TURN - half
        return self.direction * turned * 2.0 * math.pi / COUNTS_PER_TURN


class As5600Keys(chip.Keys, frozen=True, kw_only=True):
    """Keys of the encoders at joints.

    Attributes:
        bus: I2C bus.
        mux: Address of the multiplexer.
        rows: Joints, keyed by name.
    """

    bus: chip.BusNumber = 1
    mux: Annotated[int, Meta(ge=0x70, le=0x77)] = 0x70
    rows: dict[str, JointKeys]

    def __post_init__(self) -> None:
        """Refuse two joints on one channel."""
        users: dict[int, str] = {}
        for name, joint in self.rows.items():
            if (other := users.setdefault(joint.channel, name)) != name:
                raise chip.KeyMistake(
                    name, f"has the channel {joint.channel}, which {other} has, too"
                )

    def claims(self) -> Iterator[chip.Claim]:
        """Return the claims of the addresses; all encoders of a bus share one address."""
        yield from chip.i2c_claims(self.bus, "mux", self.mux)
        yield chip.Claim("driver", f"address {ADDRESS:#x} of I2C bus {self.bus}")


Magnet = Literal["", "gone", "weak", "strong"]
"""State of the magnet: "" if it is in order, missing ("gone"), too weak or too strong."""


class As5600(chip.I2cDevice):
    """Encoders of several joints, behind the multiplexer; see `SensorDriver`."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        keys = As5600Keys.of(plan.settings)
        mux = chip.I2cKeys(bus=keys.bus, address=keys.mux)
        super().__init__(f"The multiplexer of sensor {plan.name!r}", mux, hardware)
        self.joints = keys.rows
        self._missed = dict.fromkeys(keys.rows, 0)

    def measure(self, joint: str) -> tuple[int, Magnet]:
        """Return a joint's raw angle, 0 to 4095, valid only with a magnet; and its `Magnet`."""
        channel = self.joints[joint].channel
        with chip.device_errors(self.name):
            self._bus.write_byte(self._address, 1 << channel)
        with chip.device_errors(f"The encoder of {joint}, on channel {channel},"):
            status, high, low = self._bus.read_i2c_block_data(ADDRESS, _STATUS, 3)
        magnet: Magnet = "strong" if status & _TOO_STRONG else "weak" if status & _TOO_WEAK else ""
        if not status & _MAGNET_DETECTED:
            magnet = "gone"
        return (high << 8 | low) % COUNTS_PER_TURN, magnet

    def counts(self, joint: str) -> int:
        """Return the raw angle of one joint, 0 to 4095; raise RobotError without a magnet."""
        counts, magnet = self.measure(joint)
        if magnet == "gone":
            channel = self.joints[joint].channel
            raise RobotError(f"The encoder of {joint}, on channel {channel}, detects no magnet.")
        return counts

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return each joint's angle, such as `MCP_flexion/angle`, rad, -pi to pi around its zero.

        Joints without a reading are omitted; the fifth miss of a joint in a row raises RobotError.
        """
        said: dict[str, float] = {}
        failures: dict[str, None] = {}  # A missing multiplexer is reported once.
        for name, joint in self.joints.items():
            try:
                said[f"{name}/angle"] = joint.angle(self.counts(name))
                self._missed[name] = 0
            except RobotError as error:
                self._missed[name] += 1
                if self._missed[name] >= _MOST_MISSED:
                    failures[str(error)] = None
        if failures:
            raise RobotError(" ".join(failures))
        return said


def open_and_read(plan: SensorPlan, hardware: Hardware) -> As5600:
    """Open the sensor and read each encoder once."""
    with ExitStack() as undo:
        sensor = undo.enter_context(closing(As5600(plan, hardware)))
        for joint in sensor.joints:
            sensor.counts(joint)
        undo.pop_all()
    return sensor


_STATUS_OF: Final = {
    "": _MAGNET_DETECTED,
    "gone": _TOO_WEAK,
    "weak": _MAGNET_DETECTED | _TOO_WEAK,
    "strong": _MAGNET_DETECTED | _TOO_STRONG,
}


class Tca9548a(SimulatedChip):
    """TCA9548A: multiplexer of one I2C bus to eight; all channels are closed at power-on."""

    is_logged = False  # It has no outputs, and hundreds of writes a second would fill the ledger.

    def __init__(self) -> None:
        self.control = 0  # Its register, with a bit for each channel.

    def read(self, register: int, length: int) -> list[int]:
        """Read the control register; sending the register byte writes it first."""
        self.control = register
        return [self.control] * length

    def write(self, register: int, data: Sequence[int]) -> None:
        """Write the control register; only the last byte counts, including the register byte."""
        self.control = (register, *data)[-1]


class SimulatedAs5600s(SimulatedChip):
    """AS5600 chips behind a multiplexer, at their common address; they have no settings.

    `measured` returns one reading of a joint's angle, rad.
    """

    def __init__(
        self, mux: Tca9548a, joints: Mapping[str, JointKeys], measured: Callable[[str], float]
    ) -> None:
        self._mux, self._joints, self._measured = mux, joints, measured
        self.magnets: dict[str, Magnet] = dict.fromkeys(joints, "")  # State of each magnet.
        for name in joints:
            measured(name)

    def read(self, register: int, length: int) -> list[int]:
        """Read all encoders behind open channels: a bit that one of them pulls low is low."""
        names = [name for name, one in self._joints.items() if self._mux.control >> one.channel & 1]
        if not names:
            raise OSError(errno.EREMOTEIO, "no chip answers")  # Same error as from the kernel.
        data = [0xFF] * length
        for name in names:
            status, counts = _STATUS_OF[self.magnets[name]], 0
            if self.magnets[name] != "gone":
                keys = self._joints[name]
                turned = keys.direction * self._measured(name) / (2.0 * math.pi)
                counts = (keys.zero + round(turned * COUNTS_PER_TURN)) % COUNTS_PER_TURN
            # All other registers are 0.
            known = dict(enumerate((status, *divmod(counts, 256)), _STATUS))
            data = [old & known.get(register + i, 0) for i, old in enumerate(data)]
        return data


class SimulatedJoints(SimulatedSensor):
    """A multiplexer and the encoders behind it.

    `measured_angle` of the world returns one reading of a joint's angle, rad, with the noise of its
    encoder, and raises RobotError for an unknown joint. Without it, all angles are zero.
    """

    def __init__(self, plan: SensorPlan, world: World) -> None:
        keys, mux = As5600Keys.of(plan.settings), Tca9548a()
        measured: Callable[[str], float] = getattr(world, "measured_angle", lambda _: 0.0)
        encoders = SimulatedAs5600s(mux, keys.rows, measured)
        super().__init__({(keys.bus, keys.mux): mux, (keys.bus, ADDRESS): encoders})
        self.magnets = encoders.magnets

    def set_magnet(self, joint: str, state: Magnet) -> None:
        """Set the state of the magnet of a joint."""
        require_known("fault of a magnet", _STATUS_OF, state)
        self.magnets[joint] = state


def _features(plan: SensorPlan) -> list[Feature]:
    """Return a feature for the angle of each joint, within half a turn of its zero."""
    from shapechanger.layout import Element, Feature  # The guard needs no layouts.

    return [
        Feature(f"{name}/angle", "rad", -math.pi, math.pi, Element("joint", name))
        for name in plan.settings["rows"]
    ]


AS5600: Final = chip.SensorChip(
    measures="joints",
    keys=As5600Keys,
    open=open_and_read,
    simulate=SimulatedJoints,
    features=_features,
    rows=JointKeys,
)
