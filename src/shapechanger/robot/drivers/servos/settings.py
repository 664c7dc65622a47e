"""Settings of a servo bus: models, servos with their tendons, and limits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, NamedTuple

from msgspec import Meta

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.keys import Claim, FilePath, KeyMistake, Keys
from shapechanger.robot.drivers.servos.family import (
    COUNTS_PER_TURN,
    DYNAMIXEL,
    FEETECH,
    WATCHDOG_STEP_MS,
    Control,
    ServoFamily,
)

DRIVER: Final = "bus_servo"
"""Driver of the outputs and of the sensor of a servo bus, in a profile."""

_ROUNDING: Final = 1e-9
"""Added to a quotient before rounding down: 3 may come out as 2.9999999999."""


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
"""Models that the driver supports, by name."""


def stops_itself(output: OutputPlan) -> bool:
    """Return whether an output is a servo that stops by itself when its bus is silent."""
    return output.driver == DRIVER and MODELS[output.settings["model"]].family.has_watchdog


class ServoSettings(Keys, frozen=True, kw_only=True):
    """A servo and its tendon.

    A tension is that of the current without friction. The gears take some newtons of it when the
    spool winds in, and add as much when the tendon pulls it out; see `Gears.friction_nm`.

    Attributes:
        name: Name of the tendon, such as "FDP"; that of its output.
        id: Id on the bus.
        model: Name of its model; see `MODELS`.
        spool_radius_m: Radius at which the tendon leaves the spool, half its thickness included, m.
        most_tension_n: Largest tension, N. The servo's own limit is set to it.
        pretension_n: Smallest tension while it holds the tendon, N.
        homing_n: Tension for finding the zero, N.
        direction: 1 if rising positions wind the tendon in, -1 if they let it out.
        control: Control of its tendon.
        longest_m: With control "length": length beyond the zero at the lowest command, m.
        shortest_m: The same at the highest command, m.
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
        """Refuse what the model cannot do."""
        family = self.known.family
        if self.id > family.most_id:
            raise KeyMistake("id", f"must be 0 to {family.most_id}, not {self.id}")
        if self.control not in family.modes:
            why = f"a {family.name} servo has no control of its current"
            raise KeyMistake("control", f"must be 'length', not 'tension', because {why}")
        if self.control == "length" and not self.shortest_m < self.longest_m:
            words = f"must be below longest_m, not {self.shortest_m:g} and {self.longest_m:g} m"
            raise KeyMistake("shortest_m", f"{words}, for control of the length")
        half = math.pi * self.spool_radius_m
        if not family.has_watchdog and max(-self.shortest_m, self.longest_m) >= half:
            far = "longest_m" if self.longest_m >= half else "shortest_m"
            raise KeyMistake(
                far,
                f"must be within {half:.4f} m of the zero, half a turn of the spool, because the "
                "servo forgets its turns with its power",
            )
        least, most = self.newton_per_goal, self.known.most_counts * self.newton_per_goal
        end = f"{most:.0f} N with this spool"
        for key in ("most_tension_n", "pretension_n", "homing_n"):
            if not least <= (value := getattr(self, key)) <= most:
                raise KeyMistake(key, f"must be {least:.2g} to {end}, not {value:g} N")
            most = self.most_tension_n  # Of the others.
            end = f"{most:g} N"

    def settings(self) -> dict[str, Any]:
        """Return the settings of the output, which has the name."""
        settings = super().settings()
        del settings["name"]
        return settings

    def claims(self) -> Iterator[Claim]:
        """Return the claim of its id."""
        yield Claim("id", f"id {self.id} of the servo bus")

    @property
    def known(self) -> ServoModel:
        """Model of the servo."""
        return MODELS[self.model]

    @property
    def newton_per_goal(self) -> float:
        """Tension per count of the goal, N."""
        return self.known.torque_constant * self.known.ampere_per_goal / self.spool_radius_m

    @property
    def most_counts(self) -> int:
        """Limit of the goal in counts: the largest that pulls at most `most_tension_n`."""
        return math.floor(self.most_tension_n / self.newton_per_goal + _ROUNDING)

    @property
    def metre_per_count(self) -> float:
        """Change of the tendon's length per count of position, m; negative if it winds in."""
        return -self.direction * 2.0 * math.pi * self.spool_radius_m / COUNTS_PER_TURN

    def clip(self, tension: float, least: float | None = None) -> float:
        """Clip a tension to the range of its servo, N.

        Args:
            tension: Tension, N.
            least: Lower end of the range, N; None for the pretension.
        """
        if not math.isfinite(tension):
            raise RobotError(f"{self.words} cannot pull {tension} N.")
        return min(max(tension, self.pretension_n if least is None else least), self.most_tension_n)

    def goal_count(self, tension: float) -> int:
        """Return the goal for a tension, rounded towards slack and at most the limit.

        Args:
            tension: Tension, N; a negative one counts as 0, because a tendon does not push.

        Returns:
            Counts, with the sign that winds in.
        """
        # Clip first: the quotient of a huge number could overflow to infinity.
        counts = math.floor(self.clip(tension, 0.0) / self.newton_per_goal + _ROUNDING)
        counts = min(counts, self.most_counts)
        # With control of the length the goal is a limit, which has no sign.
        return counts if self.control == "length" else self.direction * counts

    def position_at(self, length: float, zero: int) -> int:
        """Return the position for a length, in counts, the inverse of `length_m`.

        Args:
            length: Length beyond the zero, m, clipped to its range.
            zero: Position at the zero, in counts.
        """
        if not math.isfinite(length):
            raise RobotError(f"{self.words} cannot go to a length of {length} m.")
        kept = min(max(length, self.shortest_m), self.longest_m)
        return zero + round(kept / self.metre_per_count)

    def tension_n(self, current: int) -> float:
        """Return the tension of a current in counts, N; negative for one that lets out."""
        torque = self.known.torque_constant * self.known.ampere_per_count * current
        return self.direction * torque / self.spool_radius_m

    def length_m(self, position: int, zero: int) -> float:
        """Return the length of the tendon beyond its zero, m, which grows as it is let out.

        Args:
            position: Present position, in counts.
            zero: Position at the zero, in counts.
        """
        return (position - zero) * self.metre_per_count

    def lengthening(self, speed: float) -> float:
        """Return how fast the tendon gets longer, m/s, for a speed of the servo in rad/s."""
        return -self.direction * speed * self.spool_radius_m

    @property
    def words(self) -> str:
        """Name and id for messages."""
        return f"Servo {self.name} (id {self.id})"


class ServoBusKeys(Keys, frozen=True, kw_only=True):
    """Keys of a bus.

    Attributes:
        device: Serial device, such as "/dev/ttyUSB0".
        baud: Baud rate; one that the SDK supports.
        watchdog_ms: Silence after which the servos stop by themselves, ms.
        ramp_ms: Time in which a stop lowers the tensions to the pretension, ms.
        answer_ms: Time for the servos to start an answer, ms: one silent servo must delay the guard
            by less than the limit for sensors. The latency timer of an FTDI adapter must be below:
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
        most_missed: Missed cycles in a row that make a fault.
        cut_ms: Time after which a power switch that is not fed has cut the servos' power, ms.
    """

    servos: tuple[ServoSettings, ...]
    most_missed: int = 5
    cut_ms: int = 200

    def __post_init__(self) -> None:
        """Refuse what the servos cannot do together."""
        names = {one.known.family.name: None for one in self.servos}
        if len(names) > 1:
            raise KeyMistake("device", f"cannot have {' and '.join(names)} servos together")
        rates = self.family.baud_rates
        if self.baud not in rates:
            words = ", ".join(map(str, rates))
            raise KeyMistake("baud", f"must be one that the servos have, {words}, not {self.baud}")

    @property
    def family(self) -> ServoFamily:
        """Family of the servos."""
        return self.servos[0].known.family

    @property
    def mark(self) -> int:
        """Value of `ServoFamily.mark` while a servo has not restarted."""
        family = self.family
        return self.watchdog_ms // WATCHDOG_STEP_MS if family.has_watchdog else 254


def servo_settings(plan: OutputPlan) -> ServoSettings:
    """Return the servo of an output, which a profile has checked, by the name of the output."""
    keys = plan.settings.keys() & set(ServoSettings.__struct_fields__)
    return ServoSettings(name=plan.name, **{key: plan.settings[key] for key in keys})


def bus_settings(outputs: Sequence[OutputPlan]) -> BusSettings:
    """Return the bus of outputs, each of which has its settings."""
    settings = outputs[0].settings
    keys = settings.keys() & set(BusSettings.__struct_fields__)
    servos = tuple(map(servo_settings, outputs))
    return BusSettings(servos=servos, **{key: settings[key] for key in keys})
