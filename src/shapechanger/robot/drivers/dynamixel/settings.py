"""What is attached to the bus, and how far it may go."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.settings import number, text, whole
from shapechanger.robot.guard.plan import OutputPlan

__all__ = [
    "MODELS",
    "BusSettings",
    "ServoModel",
    "ServoSettings",
    "bus_settings",
    "model_named",
    "servo_settings",
]


@dataclass(frozen=True, slots=True)
class ServoModel:
    """One model.

    Attributes:
        name: What it is called.
        number: What it answers to a ping.
        ampere_per_count: Unit of its currents, A.
        most_counts: Largest value of its current limit.
        torque_constant: Torque at the output per ampere, N·m/A: stall torque over stall current.
        no_load_rad_per_s: Speed without load.
        least_v: Lowest voltage it works at, V.
        most_v: Highest.
        most_c: Temperature at which it switches itself off, degrees Celsius.
        least_firmware: First version whose bus watchdog can be trusted.
        friction_nm: What its gears hold against, at the output, N·m; None where nobody measured it.
    """

    name: str
    number: int
    ampere_per_count: float
    most_counts: int
    torque_constant: float
    no_load_rad_per_s: float
    least_v: float
    most_v: float
    most_c: float
    least_firmware: int = 0
    friction_nm: float | None = None


def _rpm(value: float) -> float:
    return value * 2.0 * math.pi / 60.0


# Source: ROBOTIS e-manual; X330 at 5 V, XM430 at 12 V. Friction: XL330-M288 identified by Rhoban's
# `bam` (xl330/m1), XC330-M288 fitted on joints of a LEAP hand. The bus watchdog of the X430 needs
# firmware 38 (e-manual, Bus Watchdog).
_MODELS: Final = (
    ServoModel("XL330-M288", 1200, 1e-3, 1750, 0.52 / 1.47, _rpm(103), 3.5, 7, 70, 0, 0.018),
    ServoModel("XL330-M077", 1190, 1e-3, 1750, 0.215 / 1.47, _rpm(383), 3.5, 7, 70),
    ServoModel("XC330-M288", 1240, 1e-3, 2352, 0.93 / 1.80, _rpm(81), 3.5, 7, 70, 0, 0.029),
    ServoModel("XM430-W210", 1030, 2.69e-3, 1193, 3.0 / 2.3, _rpm(77), 9.5, 16, 80, 38),
    ServoModel("XM430-W350", 1020, 2.69e-3, 1193, 4.1 / 2.3, _rpm(46), 9.5, 16, 80, 38),
)

MODELS: Final[Mapping[str, ServoModel]] = MappingProxyType({one.name: one for one in _MODELS})
"""The models that the driver knows, by name."""


def model_named(name: str) -> ServoModel:
    """A model.

    Raises:
        UnknownName: If there is no such model.
    """
    if name not in MODELS:
        raise UnknownName("servo model", name, MODELS)
    return MODELS[name]


_MOST_ID: Final = 252  # Protocol 2.0: 253 to 255 are reserved, 254 is everybody.
_MOST_WATCHDOG_MS: Final = 127 * 20


@dataclass(frozen=True, slots=True)
class ServoSettings:
    """One servo and its tendon.

    Attributes:
        name: Name of the tendon, such as "FDP".
        id: Its number on the bus, 0 to 252.
        model: Name of its model; see `MODELS`.
        spool_radius_m: Radius at which the tendon leaves the spool, half its thickness included, m.
        most_tension_n: What it may pull at most, N. The servo's own current limit is set to it.
        pretension_n: What it always pulls while it is held, N.
        direction: 1 if rising positions wind the tendon in, -1 if they let it out.
        torque_constant: N·m/A; None for what the data sheet implies. One that was measured with the
            spool on a scale is better.
        homing_n: What it pulls to find its zero, N; None for the pretension.
        shortest_m: Length, counted from its zero, that the finger cannot shorten it to, m: who
            winds in further has no tendon. Below 0.
    """

    name: str
    id: int
    model: str
    spool_radius_m: float
    most_tension_n: float
    pretension_n: float
    direction: int = 1
    torque_constant: float | None = None
    homing_n: float | None = None
    shortest_m: float = -0.06  # Chosen: the longest excursion of a finger's tendon is 42 mm.

    def __post_init__(self) -> None:
        known = model_named(self.model)
        if not 0 <= self.id <= _MOST_ID:
            self._refuse(f"its id must be 0 to {_MOST_ID}, not {self.id}")
        if self.direction not in (1, -1):
            self._refuse(f"its direction must be 1 or -1, not {self.direction}")
        for what, value in (
            ("spool radius", self.spool_radius_m),
            ("torque constant", self.newton_metre_per_ampere),
            ("most tension", self.most_tension_n),
            ("pretension", self.pretension_n),
            ("tension for homing", self.homing_tension_n),
        ):
            if not 0.0 < value < math.inf:  # Also refuses NaN.
                self._refuse(f"its {what} must be above 0, not {value:g}")
        if not -math.inf < self.shortest_m < 0.0:
            self._refuse(f"its shortest length must be below 0, not {self.shortest_m:g} m")
        least, most = self.newton_per_count, known.most_counts * self.newton_per_count
        if not least <= self.most_tension_n <= most:
            words = f"{least:.2g} to {most:.0f} N with this spool, not {self.most_tension_n:g} N"
            self._refuse(f"its most tension must be {words}")
        for what, value in (
            ("pretension", self.pretension_n),
            ("tension for homing", self.homing_tension_n),
        ):
            if not least <= value <= self.most_tension_n:
                words = f"{least:.2g} to {self.most_tension_n:g} N, not {value:g} N"
                self._refuse(f"its {what} must be {words}")

    @property
    def known(self) -> ServoModel:
        """Its model."""
        return model_named(self.model)

    @property
    def newton_metre_per_ampere(self) -> float:
        """Its torque constant."""
        given = self.torque_constant
        return self.known.torque_constant if given is None else given

    @property
    def newton_per_count(self) -> float:
        """What one count of current pulls, N."""
        return self.newton_metre_per_ampere * self.known.ampere_per_count / self.spool_radius_m

    @property
    def homing_tension_n(self) -> float:
        """What it pulls to find its zero, N."""
        return self.pretension_n if self.homing_n is None else self.homing_n

    @property
    def friction_n(self) -> float | None:
        """What its gears hold against, N at the tendon; None where nobody knows."""
        friction = self.known.friction_nm
        return None if friction is None else friction / self.spool_radius_m

    @property
    def words(self) -> str:
        """What it is called in a sentence."""
        return f"Servo {self.name} (id {self.id})"

    def _refuse(self, why: str) -> None:
        raise RobotError(f"Servo {self.name!r}: {why}.")


@dataclass(frozen=True, slots=True)
class BusSettings:
    """The bus and its servos.

    Attributes:
        device: Where it is, such as "/dev/ttyUSB0".
        servos: What is attached, in the order in which it is asked.
        baud: Bits a second; one that the SDK knows.
        answer_ms: How long the servos may take to begin to answer. The latency timer of an FTDI
            adapter must be below: `/sys/bus/usb-serial/devices/ttyUSB0/latency_timer`, 16 ms as it
            comes and 1 ms at best.
        watchdog_ms: After so long without a word the servos stop by themselves; steps of 20 ms.
        most_missed: A servo that is not heard in so many cycles in a row is a fault.
        ramp_ms: How long a stop takes to go down to the pretension.
        believed_cycles: How many cycles a voltage or temperature must be wrong to be believed.
        margin_c: How far below its own limit a temperature is too hot, degrees.
        slack_share: Share of the speed without load from which on a tendon that winds in carries
            nothing.
        slack_ms: For how long.
        fast: Whether to try the fast sync read; what does not answer it is read the plain way.
    """

    device: str
    servos: tuple[ServoSettings, ...]
    baud: int = 1_000_000
    answer_ms: float = 6.0
    watchdog_ms: int = 100
    most_missed: int = 5
    ramp_ms: int = 300
    believed_cycles: int = 3
    margin_c: float = 5.0
    slack_share: float = 0.7
    slack_ms: int = 100
    fast: bool = False

    def __post_init__(self) -> None:
        if not self.servos:
            raise RobotError(f"The bus at {self.device} needs at least one servo.")
        for what, values in (
            ("id", [one.id for one in self.servos]),
            ("name", [one.name for one in self.servos]),
        ):
            value, times = Counter[object](values).most_common(1)[0]
            if times > 1:
                raise RobotError(f"The bus at {self.device} has {times} servos of {what} {value}.")
        if not 20 <= self.watchdog_ms <= _MOST_WATCHDOG_MS or self.watchdog_ms % 20:
            raise RobotError(
                f"watchdog_ms must be 20 to {_MOST_WATCHDOG_MS} in steps of 20, "
                f"not {self.watchdog_ms}."
            )
        for what, value, least in (
            ("answer_ms", self.answer_ms, 0.1),
            ("most_missed", self.most_missed, 1),
            ("ramp_ms", self.ramp_ms, 0),
            ("believed_cycles", self.believed_cycles, 1),
            ("margin_c", self.margin_c, 0),
            ("slack_share", self.slack_share, 0.05),
            ("slack_ms", self.slack_ms, 1),
        ):
            if not least <= value < math.inf:
                raise RobotError(f"{what} must be {least:g} or more, not {value:g}.")


def servo_settings(plan: OutputPlan) -> ServoSettings:
    """The servo of an output, by the name of the output.

    Raises:
        RobotError: If it cannot be as it is set.
        UnknownName: If there is no such model.
    """
    settings = plan.settings
    return ServoSettings(
        name=plan.name,
        id=whole(settings, "id"),
        model=text(settings, "model"),
        spool_radius_m=number(settings, "spool_radius_m"),
        most_tension_n=number(settings, "most_tension_n"),
        pretension_n=number(settings, "pretension_n"),
        direction=whole(settings, "direction"),
        homing_n=number(settings, "homing_n"),
    )


def bus_settings(settings: Mapping[str, object], servos: tuple[ServoSettings, ...]) -> BusSettings:
    """A bus with these servos.

    Args:
        settings: Of any of its outputs: each has those of the bus too.
        servos: What is on it.

    Raises:
        RobotError: If it cannot be as it is set, or two servos have one id.
    """
    return BusSettings(
        device=text(settings, "device"),
        servos=servos,
        baud=whole(settings, "baud"),
        answer_ms=number(settings, "answer_ms"),
        watchdog_ms=whole(settings, "watchdog_ms"),
        ramp_ms=whole(settings, "ramp_ms"),
    )
