"""Servos on a bus: the registers, units and errors of their families, and their models.

The numbers and their sources are in `servos.toml`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import msgspec

COUNTS_PER_TURN: Final = 4096
"""Counts of position per turn."""

_RAD_PER_S_PER_RPM: Final = 2.0 * math.pi / 60.0

TRIPPED: Final = 0xFF
"""Value of a bus watchdog after it has stopped the servo."""
WATCHDOG_STEP_MS: Final = 20
"""Unit of a bus watchdog, ms."""

Control = Literal["tension", "length"]
"""Control of a tendon: by its tension, or by its length with a limit of the tension."""


class Register(msgspec.Struct, frozen=True):
    """A register of the control table.

    Attributes:
        name: Name in the manual.
        address: Address of its first byte.
        size: Size in bytes, little-endian.
        sign: Code of a negative number, two's complement or a sign in the highest bit; "" without.
        initial: Value at delivery, and after power-on if it is not in the EEPROM.
        range: Smallest and largest value; without `range` and `values` it is read-only.
        values: Values that it takes, where they are no range.
    """

    name: str
    address: int
    size: int
    sign: Literal["", "complement", "bit"] = ""
    initial: int = 0
    range: tuple[int, int] | None = None
    values: tuple[int, ...] = ()

    @property
    def is_writable(self) -> bool:
        """Whether it takes values."""
        return self.range is not None or bool(self.values)

    def takes(self, value: int) -> bool:
        """Return whether it takes a value."""
        least, most = self.range or (0, -1)
        return least <= value <= most or value in self.values

    def encode(self, value: int) -> bytes:
        """Encode a value."""
        if self.sign == "bit" and value < 0:
            value = -value | 1 << (8 * self.size - 1)
        return value.to_bytes(self.size, "little", signed=self.sign == "complement")

    def decode(self, data: bytes, start: int = 0) -> int:
        """Decode the value in `data`, which is at `start` there."""
        part = data[start : start + self.size]
        value = int.from_bytes(part, "little", signed=self.sign == "complement")
        top = 1 << (8 * self.size - 1)
        return top - value if self.sign == "bit" and value >= top else value


class Constant(Register, frozen=True, kw_only=True):
    """A register with its value, and the bits that are kept as they are."""

    value: int
    kept_bits: int = 0


class Present(NamedTuple):
    """Present values of a servo.

    Attributes:
        current: Current, in counts of the model.
        speed: Speed, rad/s.
        position: Position over many turns, in counts of 1/4096 turn.
        voltage: Voltage, V.
        temperature: Temperature, degrees Celsius.
    """

    current: int
    speed: float
    position: int
    voltage: float
    temperature: float


class ServoFamily(msgspec.Struct, frozen=True):
    """A family of servos, which share registers and packets.

    Attributes:
        name: Name of the family.
        protocol: Version of the packets in `dynamixel_sdk`; Feetech's follow 1.0, with the
            instructions for several servos of 2.0.
        address_size: Bytes of an address, a length or a checksum in a packet.
        most_id: Highest id.
        baud_rates: Baud rates of servos and SDK.
        has_watchdog: Whether a servo stops by itself when its bus is silent. Without, a power
            switch must stop it, and without power it forgets its turns.
        alert: Bits of a reply's error that say that the hardware error status is not 0.
        refused: Bits of a reply's error with the reason of a refusal.
        errors: Bits of the hardware error status, in words.
        speed_rpm: Unit of the speed, turns per minute.
        modes: Value of `mode` for each control that it has.
        constants: Registers of the EEPROM with the values that they must have.
        eeprom_end: First address behind the EEPROM.
        lock: Register that must be 0 to write to the EEPROM; None if that needs no torque.
        model_number: Model number.
        firmware: Version of the firmware.
        mode: Operating mode.
        most: Limit of `goal`, in the EEPROM.
        torque_enable: 1 for torque, 0 for none.
        mark: Register that is 0 after a restart, and has another value meanwhile: the bus watchdog
            if there is one, or an unlimited acceleration.
        goal: Goal of the current, or in control of the length its limit. Of a family without
            control of the tension it is a limit in thousandths of the stall torque.
        goal_position: Goal position.
        hardware_error: Hardware error status.
        present: Block of all present values.
        current: Present current.
        speed: Present speed.
        position: Present position.
        voltage: Present voltage, 0.1 V.
        temperature: Present temperature, degrees Celsius.
    """

    name: str
    protocol: float
    address_size: int
    most_id: int
    baud_rates: tuple[int, ...]
    has_watchdog: bool
    alert: int
    refused: int
    errors: Mapping[int, str]
    speed_rpm: float
    modes: Mapping[Control, int]
    constants: tuple[Constant, ...]
    eeprom_end: int
    model_number: Register
    firmware: Register
    mode: Register
    most: Register
    torque_enable: Register
    mark: Register
    goal: Register
    goal_position: Register
    hardware_error: Register
    present: Register
    current: Register
    speed: Register
    position: Register
    voltage: Register
    temperature: Register
    lock: Register | None = None

    @property
    def rad_per_s(self) -> float:
        """Unit of the speed, rad/s."""
        return self.speed_rpm * _RAD_PER_S_PER_RPM

    def decode(self, data: bytes) -> Present:
        """Decode the bytes of `present`."""
        parts = (self.current, self.speed, self.position, self.voltage, self.temperature)
        start = self.present.address
        current, speed, position, volts, degrees = (
            one.decode(data, one.address - start) for one in parts
        )
        return Present(current, speed * self.rad_per_s, position, volts * 0.1, float(degrees))

    @property
    def registers(self) -> list[Register]:
        """All registers but the block of present values."""
        named = msgspec.structs.asdict(self).values()
        registers = [one for one in (*named, *self.constants) if isinstance(one, Register)]
        return [one for one in registers if one != self.present]

    def error_words(self, bits: int) -> str:
        """Describe the bits of the hardware error status."""
        words = (words for bit, words in sorted(self.errors.items()) if bits >> bit & 1)
        return ", ".join(words) or f"it gives the unknown code {bits}"


ModelName = Literal["XL330-M288", "XL330-M077", "XC330-M288", "XM430-W210", "XM430-W350", "STS3215"]
"""Name of a model that the driver supports."""


class Gears(msgspec.Struct, frozen=True):
    """Motor and gears of a servo, at the output.

    Attributes:
        inertia: Inertia, kg·m2.
        friction_nm: Coulomb friction, N·m.
        viscous: Viscous friction, N·m·s/rad.
        is_measured: Whether the friction was measured.
    """

    inertia: float
    friction_nm: float
    viscous: float
    is_measured: bool = False


class ServoModel(msgspec.Struct, frozen=True):
    """Model of a servo.

    Attributes:
        name: Name of the model.
        number: Model number.
        ampere_per_count: Unit of its present current, A.
        most_counts: Largest value of its goal, see `ServoFamily.goal`.
        stall_nm: Stall torque at `volts`, N·m.
        stall_a: Stall current at `volts`, A.
        no_load_rpm: Speed without load at `volts`, turns per minute.
        volts: Nominal voltage, V.
        least_v: Lowest operating voltage, V.
        most_v: Highest operating voltage, V.
        most_c: Temperature at which it shuts itself off, degrees Celsius.
        shutdown: Hardware errors that shut it off, as bits.
        least_firmware: First version with a reliable bus watchdog.
        gears: Motor and gears.
        family_name: Name of its family.
    """

    name: str
    number: int
    ampere_per_count: float
    most_counts: int
    stall_nm: float
    stall_a: float
    no_load_rpm: float
    volts: float
    least_v: float
    most_v: float
    most_c: int
    shutdown: int
    gears: Gears
    family_name: str
    least_firmware: int = 0

    @property
    def family(self) -> ServoFamily:
        """Family of the servo."""
        return FAMILIES[self.family_name]

    @property
    def torque_constant(self) -> float:
        """Torque at the output per current, N·m/A."""
        return self.stall_nm / self.stall_a

    @property
    def no_load_rad_per_s(self) -> float:
        """Speed without load, rad/s."""
        return self.no_load_rpm * _RAD_PER_S_PER_RPM

    @property
    def ampere_per_goal(self) -> float:
        """Unit of its goal, A; where that is a share of the stall torque, for a motor at rest."""
        is_current = "tension" in self.family.modes
        return self.ampere_per_count if is_current else self.stall_a / self.most_counts


class _Table(msgspec.Struct):
    family: list[ServoFamily]
    model: list[ServoModel]


_TABLE: Final = msgspec.toml.decode(
    Path(__file__).with_name("servos.toml").read_bytes(), type=_Table
)

FAMILIES: Final[Mapping[str, ServoFamily]] = MappingProxyType({f.name: f for f in _TABLE.family})
"""Families of servos, keyed by name."""

MODELS: Final[Mapping[str, ServoModel]] = MappingProxyType({m.name: m for m in _TABLE.model})
"""Models that the driver supports, keyed by name."""
