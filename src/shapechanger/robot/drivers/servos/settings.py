"""Settings of a servo bus: the keys of servos with their tendons and of the bus, and units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Final, Literal

from msgspec import Meta
from msgspec.structs import replace

from shapechanger.contract.plan import OutputPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import Claim, FilePath, KeyMistake, Keys
from shapechanger.robot.drivers.servos.family import (
    COUNTS_PER_TURN,
    MODELS,
    WATCHDOG_STEP_MS,
    Control,
    ModelName,
    ServoFamily,
    ServoModel,
)

DRIVER: Final = "bus_servo"
"""Driver of the outputs and of the sensor of a servo bus, in a profile."""

_ROUNDING: Final = 1e-9
"""Added to a quotient before rounding down: 3 may come out as 2.9999999999."""


def stops_itself(output: OutputPlan) -> bool:
    """Return whether an output is a servo that stops by itself when its bus is silent."""
    return output.driver == DRIVER and MODELS[output.settings["model"]].family.has_watchdog


class ServoSettings(Keys, frozen=True, kw_only=True):
    """A servo and its tendon.

    A tension follows from the current without friction. The gears take some newtons of it when the
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

    servos: tuple[ServoSettings, ...] = ()
    most_missed: int = 5
    cut_ms: int = 200

    def __post_init__(self) -> None:
        """Refuse what the servos cannot do together."""
        names = {one.known.family.name: None for one in self.servos}
        if len(names) > 1:
            raise KeyMistake("device", f"cannot have {' and '.join(names)} servos together")
        if self.servos and self.baud not in (rates := self.family.baud_rates):
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


def bus_settings(outputs: Sequence[OutputPlan]) -> BusSettings:
    """Return the bus of outputs, each of which has its settings."""
    servos = tuple(ServoSettings.of(output.settings) for output in outputs)
    return replace(BusSettings.of(outputs[0].settings), servos=servos)
