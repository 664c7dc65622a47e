"""Settings of a servo bus: models, servos with their tendons, and limits."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any, Final, Literal, get_args

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.guard.plan import OutputPlan

COUNTS_PER_TURN: Final = 4096
"""Counts of position per turn."""

_ROUNDING: Final = 1e-9
"""Added to a quotient before rounding down: 3 may come out as 2.9999999999."""


@dataclass(frozen=True, slots=True)
class ServoModel:
    """Model of a servo.

    Attributes:
        name: Name of the model.
        number: Model number, its answer to a ping.
        ampere_per_count: Unit of its currents, A.
        most_counts: Largest value of its current limit, in that unit.
        stall_nm: Stall torque at `volts`, N·m.
        stall_a: Stall current at `volts`, A.
        no_load_rpm: Speed without load at `volts`, turns per minute.
        volts: Nominal voltage, V.
        least_v: Lowest operating voltage, V.
        most_v: Highest operating voltage, V.
        most_c: Temperature at which it shuts itself off, degrees Celsius.
        least_firmware: First version with a reliable bus watchdog.
        friction_nm: Friction of its gears at the output, N·m; None where it was not measured.
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
    least_firmware: int = 0
    friction_nm: float | None = None

    @property
    def torque_constant(self) -> float:
        """Torque at the output per current, N·m/A."""
        return self.stall_nm / self.stall_a

    @property
    def no_load_rad_per_s(self) -> float:
        """Speed without load, rad/s."""
        return self.no_load_rpm * 2.0 * math.pi / 60.0


# Source: ROBOTIS e-manual. Friction: XL330-M288 identified by Rhoban's `bam` (xl330/m1),
# XC330-M288 fitted on joints of a LEAP hand. The bus watchdog of the X430 needs firmware 38
# (e-manual, Bus Watchdog). The numbers are in the order of the attributes.
_MODELS: Final = (
    ServoModel("XL330-M288", 1200, 1e-3, 1750, 0.52, 1.47, 103.0, 5.0, 3.5, 7.0, 70, 0, 0.018),
    ServoModel("XL330-M077", 1190, 1e-3, 1750, 0.215, 1.47, 383.0, 5.0, 3.5, 7.0, 70),
    ServoModel("XC330-M288", 1240, 1e-3, 2352, 0.93, 1.80, 81.0, 5.0, 3.5, 7.0, 70, 0, 0.029),
    ServoModel("XM430-W210", 1030, 2.69e-3, 1193, 3.0, 2.3, 77.0, 12.0, 9.5, 16.0, 80, 38),
    ServoModel("XM430-W350", 1020, 2.69e-3, 1193, 4.1, 2.3, 46.0, 12.0, 9.5, 16.0, 80, 38),
)

MODELS: Final[Mapping[str, ServoModel]] = MappingProxyType({one.name: one for one in _MODELS})
"""Models that the driver supports, by name."""


def model_named(name: str) -> ServoModel:
    """Return a model by its name.

    Raises:
        UnknownName: If there is no such model.
    """
    if name not in MODELS:
        raise UnknownName("servo model", name, MODELS)
    return MODELS[name]


Control = Literal["tension", "length"]
"""Control of a tendon: by its tension, or by its length with a limit of the tension."""

_MOST_ID: Final = 252  # Protocol 2.0: 253 to 255 are reserved, 254 is broadcast.
_MOST_WATCHDOG_MS: Final = 127 * 20
_BAUD_RATES: Final = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)


@dataclass(frozen=True, slots=True)
class ServoSettings:
    """A servo and its tendon.

    A tension is that of the current without friction. The gears take some newtons of it when the
    spool winds in, and add as much when the tendon pulls it out; see `ServoModel.friction_nm`.

    Attributes:
        name: Name of the tendon, such as "FDP".
        id: Id on the bus, 0 to 252.
        model: Name of its model; see `MODELS`.
        spool_radius_m: Radius at which the tendon leaves the spool, half its thickness included, m.
        most_tension_n: Largest tension, N. The servo's own current limit is set to it.
        pretension_n: Smallest tension while it holds the tendon, N.
        homing_n: Tension for finding the zero, N.
        direction: 1 if rising positions wind the tendon in, -1 if they let it out.
        control: Control of its tendon.
        longest_m: With control "length": length beyond the zero at the lowest command, m.
        shortest_m: The same at the highest command, m.
    """

    name: str
    id: int
    model: str
    spool_radius_m: float
    most_tension_n: float
    pretension_n: float
    homing_n: float
    direction: int = 1
    control: Control = "tension"
    longest_m: float = 0.0
    shortest_m: float = 0.0

    def __post_init__(self) -> None:
        known = model_named(self.model)
        if not 0 <= self.id <= _MOST_ID:
            self._refuse(f"its id must be 0 to {_MOST_ID}, not {self.id}")
        if self.direction not in (1, -1):
            self._refuse(f"its direction must be 1 or -1, not {self.direction}")
        if self.control not in get_args(Control):
            raise UnknownName("control of a tendon", self.control, get_args(Control))
        if self.control == "length" and not -math.inf < self.shortest_m < self.longest_m < math.inf:
            words = f"{self.shortest_m:g} and {self.longest_m:g} m"
            self._refuse(f"control of its length needs shortest_m below longest_m, not {words}")
        if not 0.0 < self.spool_radius_m < math.inf:  # Also refuses NaN.
            self._refuse(f"its spool radius must be above 0, not {self.spool_radius_m:g}")
        least, most = self.newton_per_count, known.most_counts * self.newton_per_count
        if not least <= self.most_tension_n <= most:
            words = f"{least:.2g} to {most:.0f} N with this spool, not {self.most_tension_n:g} N"
            self._refuse(f"its most tension must be {words}")
        for label, value in (
            ("pretension", self.pretension_n),
            ("tension for homing", self.homing_n),
        ):
            if not least <= value <= self.most_tension_n:
                words = f"{least:.2g} to {self.most_tension_n:g} N, not {value:g} N"
                self._refuse(f"its {label} must be {words}")

    @property
    def known(self) -> ServoModel:
        """Model of the servo."""
        return model_named(self.model)

    @property
    def newton_per_count(self) -> float:
        """Tension per count of current, N."""
        return self.known.torque_constant * self.known.ampere_per_count / self.spool_radius_m

    @property
    def friction_n(self) -> float | None:
        """Friction of the gears at the tendon, N; None where it is unknown."""
        friction = self.known.friction_nm
        return None if friction is None else friction / self.spool_radius_m

    @property
    def most_counts(self) -> int:
        """Current limit in counts: the largest that pulls at most `most_tension_n`."""
        return math.floor(self.most_tension_n / self.newton_per_count + _ROUNDING)

    @property
    def metre_per_count(self) -> float:
        """Change of the tendon's length per count of position, m; negative if it winds in."""
        return -self.direction * 2.0 * math.pi * self.spool_radius_m / COUNTS_PER_TURN

    def clip(self, tension: float) -> float:
        """Clip a tension to the range from pretension to `most_tension_n`, N.

        Raises:
            RobotError: If it is not finite.
        """
        if not math.isfinite(tension):
            raise RobotError(f"{self.words} cannot pull {tension} N.")
        return min(max(tension, self.pretension_n), self.most_tension_n)

    def goal_count(self, tension: float) -> int:
        """Return the goal current for a tension, rounded towards slack and at most the limit.

        Args:
            tension: Tension, N; a negative one counts as 0, because a tendon does not push.

        Returns:
            Counts, with the sign that winds in.

        Raises:
            RobotError: If the tension is not finite.
        """
        if not math.isfinite(tension):
            raise RobotError(f"{self.words} cannot pull {tension} N.")
        # Clip first: the quotient of a huge number could overflow to infinity.
        pulled = min(max(tension, 0.0), self.most_tension_n)
        counts = math.floor(pulled / self.newton_per_count + _ROUNDING)
        counts = min(counts, self.most_counts)
        # With control of the length the goal current is a limit, which has no sign.
        return counts if self.control == "length" else self.direction * counts

    def position_at(self, length: float, zero: int) -> int:
        """Return the position for a length, in counts, the inverse of `length_m`.

        Args:
            length: Length beyond the zero, m, clipped to its range.
            zero: Position at the zero, in counts.

        Raises:
            RobotError: If the length is not finite.
        """
        if not math.isfinite(length):
            raise RobotError(f"{self.words} cannot go to a length of {length} m.")
        kept = min(max(length, self.shortest_m), self.longest_m)
        return zero + round(kept / self.metre_per_count)

    def tension_n(self, current: int) -> float:
        """Return the tension of a current in counts, N; negative for one that lets out."""
        return self.direction * current * self.newton_per_count

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

    def _refuse(self, why: str) -> None:
        raise RobotError(f"Servo {self.name!r}: {why}.")


@dataclass(frozen=True, slots=True)
class BusSettings:
    """A bus and its servos.

    Attributes:
        device: Serial device, such as "/dev/ttyUSB0".
        servos: Servos, in the order in which they are read.
        baud: Baud rate; one that the SDK supports.
        answer_ms: Time for the servos to start an answer, ms. The latency timer of an FTDI adapter
            must be below: `/sys/bus/usb-serial/devices/ttyUSB0/latency_timer`, by default 16 ms and
            at best 1 ms.
        watchdog_ms: Silence after which the servos stop by themselves, ms; a multiple of 20.
        most_missed: Missed cycles in a row that make a fault.
        ramp_ms: Time in which a stop lowers the tensions to the pretension, ms.
    """

    device: str
    servos: tuple[ServoSettings, ...]
    baud: int = 1_000_000
    answer_ms: float = 6.0
    watchdog_ms: int = 100
    most_missed: int = 5
    ramp_ms: int = 300

    def __post_init__(self) -> None:
        if not self.servos:
            raise RobotError(f"The bus at {self.device} needs at least one servo.")
        for label, values in (
            ("id", [one.id for one in self.servos]),
            ("name", [one.name for one in self.servos]),
        ):
            value, times = Counter[object](values).most_common(1)[0]
            if times > 1:
                raise RobotError(f"The bus at {self.device} has {times} servos of {label} {value}.")
        if self.baud not in _BAUD_RATES:
            rates = ", ".join(map(str, _BAUD_RATES))
            raise RobotError(f"No servo has {self.baud} baud; the baud rates are {rates}.")
        if not 20 <= self.watchdog_ms <= _MOST_WATCHDOG_MS or self.watchdog_ms % 20:
            raise RobotError(
                f"watchdog_ms must be 20 to {_MOST_WATCHDOG_MS} in steps of 20, "
                f"not {self.watchdog_ms}."
            )
        for label, value, least in (
            ("answer_ms", self.answer_ms, 0.1),
            ("most_missed", self.most_missed, 1),
            ("ramp_ms", self.ramp_ms, 0),
        ):
            if not least <= value < math.inf:
                raise RobotError(f"{label} must be {least:g} or more, not {value:g}.")


def servo_settings(plan: OutputPlan) -> ServoSettings:
    """Return the servo of an output; its name is that of the output.

    Raises:
        RobotError: If a setting is out of range.
        UnknownName: If there is no such model.
    """
    keys = [field.name for field in fields(ServoSettings) if field.name != "name"]
    return ServoSettings(plan.name, **{key: plan.settings[key] for key in keys})


def bus_settings(settings: Mapping[str, Any], servos: tuple[ServoSettings, ...]) -> BusSettings:
    """Return a bus with these servos.

    Args:
        settings: Settings of any of its outputs, which include those of the bus.
        servos: Its servos.

    Raises:
        RobotError: If a setting is out of range, or two servos have the same id or name.
    """
    keys = [field.name for field in fields(BusSettings) if field.name in settings]
    return BusSettings(servos=servos, **{key: settings[key] for key in keys})
