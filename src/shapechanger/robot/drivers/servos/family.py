"""Servos on a bus: the registers, units and errors of their families, and their models.

Sources: ROBOTIS e-manual, control tables of the X series and DYNAMIXEL Protocol 2.0; for Feetech's
STS series the maker's memory table of the STS3215, as the crate `st3215` 0.0.2 reproduces it, and
signs and bit 4 of the phase as in LeRobot (`motors/feetech/tables.py`; pull request 3373).
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

COUNTS_PER_TURN: Final = 4096
"""Counts of position per turn."""

TRIPPED: Final = 0xFF
"""Value of a bus watchdog after it has stopped the servo."""
WATCHDOG_STEP_MS: Final = 20
"""Unit of a bus watchdog, ms."""

Control = Literal["tension", "length"]
"""Control of a tendon: by its tension, or by its length with a limit of the tension."""


@dataclass(frozen=True, slots=True)
class Register:
    """A register of the control table.

    Attributes:
        name: Name in the manual.
        address: Address of its first byte.
        size: Size in bytes, little-endian.
        sign: Code of a negative number, two's complement or a sign in the highest bit; "" without.
        initial: Value at delivery, and after power-on if it is not in the EEPROM.
        values: Values that it takes; None if it is read-only.
    """

    name: str
    address: int
    size: int
    sign: Literal["", "complement", "bit"] = ""
    initial: int = 0
    values: Container[int] | None = None

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


@dataclass(frozen=True, slots=True)
class ServoFamily:
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
        rad_per_s: Unit of the speed, rad/s.
        modes: Value of `mode` for each control that it has.
        constants: Registers of the EEPROM with their values, and the bits of each that are kept.
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
    rad_per_s: float
    modes: Mapping[Control, int]
    constants: tuple[tuple[Register, int, int], ...]
    eeprom_end: int
    lock: Register | None
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
        named = [getattr(self, field.name) for field in fields(self)]
        registers = [*named, *(register for register, _, _ in self.constants)]
        return [one for one in registers if isinstance(one, Register) and one != self.present]

    def error_words(self, bits: int) -> str:
        """Describe the bits of the hardware error status."""
        words = (words for bit, words in sorted(self.errors.items()) if bits >> bit & 1)
        return ", ".join(words) or f"it gives the unknown code {bits}"


_ERRORS: Final = {
    0: "its voltage is out of range",
    2: "it is overheated",
    3: "its encoder fails",
    4: "it has an electrical fault",
    5: "it is overloaded",
}

DYNAMIXEL: Final = ServoFamily(
    name="Dynamixel",
    protocol=2.0,
    address_size=2,
    most_id=252,  # 253 to 255 are reserved, 254 is broadcast.
    baud_rates=(9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000),
    has_watchdog=True,
    alert=0x80,
    refused=0x7F,
    errors=_ERRORS,
    rad_per_s=0.229 * 2.0 * math.pi / 60.0,
    modes={"tension": 0, "length": 5},  # Current, and current-based position.
    constants=(
        (Register("return delay time", 9, 1, initial=250, values=range(255)), 0, 0),
        # Bit 0 reverses all signs, bit 3 lets a goal enable the torque.
        (Register("drive mode", 10, 1, values=range(14)), 0, 0),
    ),
    eeprom_end=64,
    lock=None,
    model_number=Register("model number", 0, 2),
    firmware=Register("firmware version", 6, 1),
    mode=Register("operating mode", 11, 1, initial=3, values=(0, 1, 3, 4, 5, 16)),
    most=Register("current limit", 38, 2, values=range(0)),
    torque_enable=Register("torque enable", 64, 1, values=range(2)),
    mark=Register("bus watchdog", 98, 1, values=range(128)),
    goal=Register("goal current", 102, 2, "complement", values=range(-32768, 32768)),
    goal_position=Register(
        "goal position", 116, 4, "complement", values=range(-1_048_575, 1_048_576)
    ),
    hardware_error=Register("hardware error status", 70, 1),
    present=Register("present current to present temperature", 126, 21),
    current=Register("present current", 126, 2, "complement"),
    speed=Register("present velocity", 128, 4, "complement"),
    position=Register("present position", 132, 4, "complement"),
    voltage=Register("present input voltage", 144, 2),
    temperature=Register("present temperature", 146, 1),
)
"""Dynamixel servos of the X series, with protocol 2.0."""

FEETECH: Final = ServoFamily(
    name="Feetech",
    protocol=1.0,
    address_size=1,
    most_id=253,
    baud_rates=(38400, 57600, 115200, 500_000, 1_000_000),
    has_watchdog=False,
    alert=0x7F,
    refused=0,
    errors=_ERRORS
    | {1: "its encoder fails", 3: "its current is too high", 4: "its angle is out of range"},
    rad_per_s=2.0 * math.pi / COUNTS_PER_TURN,
    modes={"length": 0},
    constants=(
        (Register("return delay", 7, 1, initial=250, values=range(255)), 0, 0),
        (Register("response status level", 8, 1, initial=1, values=range(2)), 1, 0),
        # Without limits of the angle, and with bit 4 of the phase, positions go over many turns.
        (Register("minimum angle limit", 9, 2, values=range(4096)), 0, 0),
        (Register("maximum angle limit", 11, 2, initial=4095, values=range(4096)), 0, 0),
        (Register("phase", 18, 1, initial=12, values=range(255)), 0x10, 0xEF),
    ),
    eeprom_end=40,
    lock=Register("lock", 55, 1, initial=1, values=range(2)),
    model_number=Register("model number", 3, 2),
    firmware=Register("firmware version", 0, 1),
    mode=Register("operation mode", 33, 1, values=range(4)),
    most=Register("maximum torque", 16, 2, values=range(0)),
    torque_enable=Register("torque switch", 40, 1, values=range(2)),
    mark=Register("acceleration", 41, 1, values=range(255)),
    goal=Register("torque limit", 48, 2, values=range(1001)),
    goal_position=Register("goal position", 42, 2, "bit", values=range(-32766, 32767)),
    hardware_error=Register("servo status", 65, 1),
    present=Register("present position to present current", 56, 15),
    current=Register("present current", 69, 2, "bit"),
    speed=Register("present speed", 58, 2, "bit"),
    position=Register("present position", 56, 2, "bit"),
    voltage=Register("present voltage", 62, 1),
    temperature=Register("present temperature", 63, 1),
)
"""Feetech servos of the STS series, which have no bus watchdog."""


ModelName = Literal["XL330-M288", "XL330-M077", "XC330-M288", "XM430-W210", "XM430-W350", "STS3215"]
"""Name of a model that the driver supports."""


class Gears(NamedTuple):
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
    is_measured: bool


# XL330-M288 and STS3215: identified by Rhoban's `bam` (m1). M077: those of the M288, scaled by the
# square of the gear ratio. XC330-M288: fits on joints of a LEAP hand, with the viscous part of the
# XL330 assumed. XM430: chosen for want of a source.
_GEARS: Final = {
    "XL330-M288": Gears(0.00199, 0.018, 0.0059, True),
    "XL330-M077": Gears(0.000144, 0.005, 0.00043, False),
    "XC330-M288": Gears(0.00141, 0.029, 0.0059, True),
    "XM430-W210": Gears(0.003, 0.09, 0.02, False),
    "XM430-W350": Gears(0.008, 0.12, 0.05, False),
    "STS3215": Gears(0.0261, 0.0515, 0.0599, True),
}


@dataclass(frozen=True, slots=True)
class ServoModel:
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
        family: Family of the servo.
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
    least_firmware: int = 0
    family: ServoFamily = DYNAMIXEL

    @property
    def gears(self) -> Gears:
        """Motor and gears."""
        return _GEARS[self.name]

    @property
    def torque_constant(self) -> float:
        """Torque at the output per current, N·m/A."""
        return self.stall_nm / self.stall_a

    @property
    def no_load_rad_per_s(self) -> float:
        """Speed without load, rad/s."""
        return self.no_load_rpm * 2.0 * math.pi / 60.0

    @property
    def ampere_per_goal(self) -> float:
        """Unit of its goal, A; where that is a share of the stall torque, for a motor at rest."""
        is_current = "tension" in self.family.modes
        return self.ampere_per_count if is_current else self.stall_a / self.most_counts


# Dynamixel: ROBOTIS e-manual; the bus watchdog of the X430 needs firmware 38 (Bus Watchdog).
# Feetech: makers' memory table, data sheet of the version for 7.4 V (19.5 kg·cm, 52 turns per
# minute) and its 8 kg·cm/A as in `bam`. The numbers are in the order of the attributes.
_MODELS: Final = (
    ServoModel("XL330-M288", 1200, 1e-3, 1750, 0.52, 1.47, 103.0, 5.0, 3.5, 7.0, 70, 53),
    ServoModel("XL330-M077", 1190, 1e-3, 1750, 0.215, 1.47, 383.0, 5.0, 3.5, 7.0, 70, 53),
    ServoModel("XC330-M288", 1240, 1e-3, 2352, 0.93, 1.80, 81.0, 5.0, 3.5, 7.0, 70, 52),
    ServoModel("XM430-W210", 1030, 2.69e-3, 1193, 3.0, 2.3, 77.0, 12.0, 9.5, 16.0, 80, 52, 38),
    ServoModel("XM430-W350", 1020, 2.69e-3, 1193, 4.1, 2.3, 46.0, 12.0, 9.5, 16.0, 80, 52, 38),
    ServoModel("STS3215", 777, 6.5e-3, 1000, 1.91, 2.44, 52.0, 7.4, 4.0, 8.0, 70, 44, 0, FEETECH),
)

MODELS: Final[Mapping[str, ServoModel]] = MappingProxyType({one.name: one for one in _MODELS})
"""Models that the driver supports, keyed by name."""
