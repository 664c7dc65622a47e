"""Servos of a bus: families and models of `servos.toml`, and the keys of servos and their bus."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from shapechanger.contract.plan import OutputPlan
from shapechanger.robot.drivers.chip import Claim, FilePath, KeyMistake, Keys

DRIVER: Final = "bus_servo"
"""Driver of the outputs and of the sensor of a servo bus, in a profile."""

COUNTS_PER_TURN: Final = 4096
"""Counts of position per turn."""
WATCHDOG_STEP_MS: Final = 20
"""Unit of a bus watchdog, ms."""
TRIPPED: Final = 0xFF
"""Value of a bus watchdog after it has stopped the servo."""
ROUNDING: Final = 1e-9
"""Added to a quotient before rounding down, because 3 may be computed as 2.9999999999."""
_RAD_PER_S_PER_RPM: Final = 2.0 * math.pi / 60.0

Control = Literal["tension", "length"]
"""Control of a tendon: by its tension, or by its length with a limit of the tension."""

ModelName = Literal["XL330-M288", "XL330-M077", "XC330-M288", "XM430-W210", "XM430-W350", "STS3215"]
"""Name of a model that the driver supports."""


class Register(msgspec.Struct, frozen=True):
    """A register of the control table."""

    name: str  # Name in the manual.
    address: int  # Address of its first byte.
    size: int  # Size in bytes, little-endian.
    # Code of negative numbers: "complement", or "bit" for the highest bit as sign; "" if unsigned.
    sign: Literal["", "complement", "bit"] = ""
    initial: int = 0  # Value at delivery, and after power-on if it is not in the EEPROM.
    # Ranges of permitted values; empty if the register is read-only.
    takes: tuple[tuple[int, int], ...] = ()
    value: int | None = None  # Value that the register must have; None for any.
    kept_bits: int = 0  # Bits that are not changed when `value` is set.

    def encode(self, value: int) -> bytes:
        """Encode a value."""
        if self.sign == "bit" and value < 0:
            value = -value | 1 << (8 * self.size - 1)
        return value.to_bytes(self.size, "little", signed=self.sign == "complement")

    def decode(self, data: bytes, start: int = 0) -> int:
        """Decode the value that begins at index `start` of `data`."""
        part = data[start : start + self.size]
        value = int.from_bytes(part, "little", signed=self.sign == "complement")
        top = 1 << (8 * self.size - 1)
        return top - value if self.sign == "bit" and value >= top else value


class ServoFamily(msgspec.Struct, frozen=True):
    """A family of servos, which share registers and packets.

    Its `registers` are keyed by purpose, and set to their `value` if they have one. Some keys:

    - `mode`: Operating mode.
    - `most`: Limit of `goal`, in the EEPROM.
    - `torque_enable`: 1 for torque, 0 for none.
    - `mark`: Reveals a restart, because only a restart leaves it at 0: the bus watchdog if the
      family has it, else the acceleration.
    - `goal`: Goal of the current; with control of the length, limit of the current. In a family
      without control of the tension, limit in thousandths of the stall torque.
    - `lock`: Must be 0 to write to the EEPROM; families without it need the torque off.
    - `present`: Block of the present values `current`, `speed`, `position`, `voltage` and
      `temperature`: counts, 0.1 V and degrees Celsius.
    """

    name: str
    # Version of the packets in `dynamixel_sdk`. Feetech uses 1.0, with 2.0's instructions for
    # several servos. Addresses, lengths and checksums have 1 byte in 1.0, and 2 bytes in 2.0.
    protocol: float
    most_id: int  # Highest id.
    baud_rates: tuple[int, ...]  # Baud rates of the servos; the SDK lacks 4.5 Mbaud.
    # Whether a servo stops by itself when its bus is silent. If false, a power switch must stop it,
    # and without power it loses its count of turns.
    has_watchdog: bool
    alert: int  # Bits of a reply's error that are set while the hardware error status is not 0.
    refused: int  # Bits of a reply's error with the reason of a refusal.
    errors: Mapping[int, str]  # Descriptions of the bits of the hardware error status.
    speed_rpm: float  # Unit of the speed, turns per minute.
    modes: Mapping[Control, int]  # Value of `mode` for each supported control.
    eeprom_end: int  # First address after the EEPROM.
    registers: Mapping[str, Register]

    def __getitem__(self, name: str) -> Register:
        """Return a register."""
        return self.registers[name]

    @property
    def rad_per_s(self) -> float:
        """Unit of the speed, rad/s."""
        return self.speed_rpm * _RAD_PER_S_PER_RPM

    def errors_as_text(self, bits: int) -> str:
        """Describe the bits of the hardware error status."""
        texts = (text for bit, text in sorted(self.errors.items()) if bits >> bit & 1)
        return ", ".join(texts) or f"it gives the unknown code {bits}"


class ServoModel(msgspec.Struct, frozen=True, array_like=True):
    """Servo model, a row of `servos.toml`; values of motor and gears refer to the output shaft."""

    name: str
    family_name: str
    number: int  # Model number.
    ampere_per_count: float  # Unit of its present current, A.
    most_counts: int  # Largest value of its `goal`, see `ServoFamily`.
    stall_nm: float  # Stall torque at `volts`, N·m.
    stall_a: float  # Stall current at `volts`, A.
    no_load_rpm: float  # Speed without load at `volts`, turns per minute.
    volts: float  # Nominal voltage, V.
    least_v: float  # Lowest operating voltage, V.
    most_v: float  # Highest operating voltage, V.
    most_c: int  # Temperature at which it shuts itself off, degrees Celsius.
    shutdown: int  # Hardware errors that shut it off, as bits.
    least_firmware: int  # First version with a reliable bus watchdog.
    inertia: float  # Inertia of motor and gears, kg·m2.
    friction_nm: float  # Coulomb friction of the gears, N·m.
    viscous: float  # Viscous friction of the gears, N·m·s/rad.
    is_measured: bool  # Whether the friction was measured.

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
        """Unit of its goal, A; a share of the stall torque is that share of the stall current."""
        is_current = "tension" in self.family.modes
        return self.ampere_per_count if is_current else self.stall_a / self.most_counts


class _Table(msgspec.Struct):
    family: list[ServoFamily]
    models: list[ServoModel]


_TABLE: Final = msgspec.toml.decode(
    Path(__file__).with_name("servos.toml").read_bytes(), type=_Table
)

FAMILIES: Final[Mapping[str, ServoFamily]] = {one.name: one for one in _TABLE.family}
"""Families of servos, keyed by name."""

MODELS: Final[Mapping[str, ServoModel]] = {one.name: one for one in _TABLE.models}
"""Models that the driver supports, keyed by name."""


def stops_itself(output: OutputPlan) -> bool:
    """Return whether an output is a servo that stops by itself when its bus is silent."""
    return output.driver == DRIVER and MODELS[output.settings["model"]].family.has_watchdog


class ServoSettings(Keys, frozen=True, kw_only=True):
    """A servo and its tendon.

    A tension is computed from the current, without friction. The friction of the gears reduces it
    by some newtons while the spool winds in, and increases it while the tendon turns it back; see
    `ServoModel.friction_nm`.

    Attributes:
        name: Name of the tendon and of its output, such as "FDP".
        id: Id on the bus.
        model: Name of its model; see `MODELS`.
        spool_radius_m: Radius of the tendon on the spool, including half its thickness, m.
        most_tension_n: Largest tension, N, which is also set as the servo's limit.
        pretension_n: Smallest tension while the servo has torque, N.
        homing_n: Tension for finding the zero, N.
        direction: 1 if rising positions wind the tendon in, -1 if they let it out.
        control: Control of its tendon.
        longest_m: With control "length": length beyond the zero at a command just above 0, m.
        shortest_m: With control "length": length beyond the zero at the largest command, m.
        zero: Position while the finger is straight, in counts of 1/4096 turn.
    """

    name: str
    id: Annotated[int, Meta(ge=0, le=253)]
    model: ModelName
    spool_radius_m: Annotated[float, Meta(gt=0, le=0.1)]
    most_tension_n: Annotated[float, Meta(gt=0, le=1000)]
    pretension_n: Annotated[float, Meta(gt=0, le=1000)]
    homing_n: Annotated[float, Meta(gt=0, le=1000)] = 3.0
    direction: Literal[1, -1] = 1
    control: Control = "tension"
    longest_m: Annotated[float, Meta(ge=-1, le=1)] = 0.0
    shortest_m: Annotated[float, Meta(ge=-1, le=1)] = 0.0
    zero: Annotated[int, Meta(ge=-1_000_000, le=1_000_000)] = 0

    def __post_init__(self) -> None:
        """Refuse settings that the model does not support."""
        family = self.known.family
        if self.id > family.most_id:
            raise KeyMistake("id", f"must be 0 to {family.most_id}, not {self.id}")
        if self.control not in family.modes:
            why = f"a {family.name} servo has no control of its current"
            raise KeyMistake("control", f"must be 'length', not 'tension', because {why}")
        if self.control == "length" and not self.shortest_m < self.longest_m:
            text = f"must be below longest_m, not {self.shortest_m:g} and {self.longest_m:g} m"
            raise KeyMistake("shortest_m", f"{text}, for control of the length")
        half = math.pi * self.spool_radius_m
        if not family.has_watchdog and max(-self.shortest_m, self.longest_m) >= half:
            far = "longest_m" if self.longest_m >= half else "shortest_m"
            text = f"must be within {half:.4f} m of the zero, half a turn of the spool"
            raise KeyMistake(far, f"{text}, because the servo loses its turns without power")
        least, most = self.newton_per_goal, self.known.most_counts * self.newton_per_goal
        end = f"{most:.0f} N with this spool"
        for key in ("most_tension_n", "pretension_n", "homing_n"):
            if not least <= (value := getattr(self, key)) <= most:
                raise KeyMistake(key, f"must be {least:.2g} to {end}, not {value:g} N")
            most = self.most_tension_n  # Limit of the other tensions.
            end = f"{most:g} N"

    def claims(self) -> Iterator[Claim]:
        """Return the claim of its id."""
        yield Claim("id", f"id {self.id} of the servo bus")

    @property
    def known(self) -> ServoModel:
        """Model of the servo."""
        return MODELS[self.model]

    @property
    def label(self) -> str:
        """Name and id for messages."""
        return f"Servo {self.name} (id {self.id})"

    @property
    def newton_per_goal(self) -> float:
        """Tension per count of the goal, N."""
        return self.known.torque_constant * self.known.ampere_per_goal / self.spool_radius_m

    @property
    def most_counts(self) -> int:
        """Limit of the goal in counts: the largest that pulls at most `most_tension_n`."""
        return math.floor(self.most_tension_n / self.newton_per_goal + ROUNDING)

    @property
    def lever_m(self) -> float:
        """Length of tendon that is wound in per angle, m/rad."""
        return self.direction * self.spool_radius_m

    @property
    def metre_per_count(self) -> float:
        """Change of the tendon's length per count, m; negative if rising counts wind it in."""
        return -self.direction * 2.0 * math.pi * self.spool_radius_m / COUNTS_PER_TURN


class ServoBusKeys(Keys, frozen=True, kw_only=True):
    """Keys of a bus.

    Attributes:
        device: Serial device, such as "/dev/ttyUSB0".
        baud: Baud rate; one that the servos and the SDK support.
        watchdog_ms: Silence after which servos with a watchdog stop by themselves, ms.
        ramp_ms: Time in which a stop lowers the tensions to the pretension, ms.
        answer_ms: Time for the servos to start an answer, ms: one silent servo must delay the guard
            by less than the limit for sensors. The latency timer of an FTDI adapter must be less:
            `/sys/bus/usb-serial/devices/ttyUSB0/latency_timer`, by default 16 ms and at best 1 ms.
    """

    device: FilePath = "/dev/ttyUSB0"
    baud: Annotated[int, Meta(ge=9600, le=4_500_000)] = 1_000_000
    watchdog_ms: Annotated[int, Meta(ge=20, le=2540, multiple_of=WATCHDOG_STEP_MS)] = 100
    ramp_ms: Annotated[int, Meta(ge=0, le=10_000)] = 300
    answer_ms: Annotated[float, Meta(ge=0.1, le=100)] = 3.0


class BusSettings(ServoBusKeys, frozen=True, kw_only=True):
    """A bus and its servos.

    Attributes:
        servos: Servos of one family, in the order in which they are read.
        cut_ms: Time until a power switch that is no longer triggered cuts the servos' power, ms.
    """

    servos: tuple[ServoSettings, ...] = ()
    cut_ms: int = 200

    def __post_init__(self) -> None:
        """Refuse settings that the servos cannot have together."""
        names = {one.known.family.name: None for one in self.servos}
        if len(names) > 1:
            raise KeyMistake("device", f"cannot have {' and '.join(names)} servos together")
        if self.servos and self.baud not in (rates := self.family.baud_rates):
            text = ", ".join(map(str, rates))
            raise KeyMistake("baud", f"must be one that the servos have, {text}, not {self.baud}")

    @property
    def family(self) -> ServoFamily:
        """Family of the servos."""
        return self.servos[0].known.family


def bus_settings(outputs: Sequence[OutputPlan]) -> BusSettings:
    """Return the bus of outputs, each of which has its settings."""
    servos = tuple(ServoSettings.of(output.settings) for output in outputs)
    return replace(BusSettings.of(outputs[0].settings), servos=servos)
