"""State of the bus, and fault detection of each servo from its readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from shapechanger.robot.drivers.servos.family import TRIPPED, Present, Register
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings

Mode = Literal["off", "held", "stopping", "silent"]
"""Mode of the bus.

"off": no servo has torque. "held": servos pull the requested tensions. "stopping": tensions ramp
down, then the servos let go. "silent": nothing is sent any more, so that the servos' own watchdogs
stop them, or without any the power switch.
"""


@dataclass(frozen=True, slots=True)
class ServoState:
    """Readings of one servo in a cycle.

    Attributes:
        position: Position over many turns, in counts of 1/4096 turn.
        length_m: Length of the tendon beyond its zero, m; None without a zero.
        lengthening_m_per_s: Rate of change of that length, m/s.
        tension_n: Tension of its present current, N, without the gears' friction.
        goal_n: Tension of its goal, N: limited and in whole counts.
    """

    position: int
    length_m: float | None
    lengthening_m_per_s: float
    tension_n: float
    goal_n: float


@dataclass(frozen=True, slots=True)
class BusState:
    """The bus after a cycle.

    Attributes:
        at_ns: Time of the cycle.
        mode: Mode from now on.
        servos: Readings of this cycle by tendon, without servos that did not answer.
        faults: Faults as sentences, by tendon, or "" for the bus. They stay until
            `ServoBus.set_up`.
    """

    at_ns: int
    mode: Mode
    servos: Mapping[str, ServoState]
    faults: Mapping[str, str]

    @property
    def reason(self) -> str:
        """All faults as one text; empty without faults."""
        return " ".join(self.faults.values())


# Consecutive cycles with a wrong voltage or temperature that make a fault.
_BELIEVED_CYCLES: Final = 3
# K below the model's temperature limit at which a servo is too hot.
_MARGIN_C: Final = 5.0
# One wrong goal was lost on the way and is replaced by the next.
_MAX_WRONG_GOALS: Final = 2
# Length from the zero, m, to which the finger cannot let a tendon shorten. Chosen: the longest
# excursion of a finger's tendon is 42 mm.
_SHORTEST_M: Final = -0.06
# Share of the speed without load, and time at it, with which a tendon counts as lost.
_SLACK_SHARE: Final = 0.7
_SLACK_NS: Final = 100_000_000


class ServoHealth:
    """Fault detection of one servo.

    There are two signs of a tendon that has snapped or come off. One that is wound in further than
    the finger allows is lost for certain, at any tension, but this needs a zero. A servo that winds
    in nearly as fast as without load shows it earlier, but only if its current overcomes the gears
    by far. A tendon that snaps while its servo stands still at the pretension is detected with the
    next pull.

    Args:
        servo: The servo.
        bus: Its bus.

    Attributes:
        fault: First fault, as a sentence, until `clear`; empty without a fault.
        missed: Cycles in a row without an answer.
        was_reset: Whether it has restarted, and so lost its zero.
    """

    def __init__(self, servo: ServoSettings, bus: BusSettings) -> None:
        self._servo = servo
        self._bus = bus
        self.was_reset = False
        self.clear()

    def clear(self) -> None:
        """Clear the fault."""
        self._slack_since_ns: int | None = None
        self._wrong_volts = self._hot = self._refused = 0
        self._was_late = False
        self.fault = ""
        self.missed = 0

    def miss(self, *, late: bool) -> None:
        """Count a cycle without an answer."""
        self.missed += 1
        self._was_late |= late
        if self.missed >= self._bus.most_missed:
            what = "answers too late" if self._was_late else "does not answer"
            self._fail(f"{what}, {self.missed} cycles in a row")

    def see(self, present: Present, length: float | None, now_ns: int, *, pulls: bool) -> None:
        """Evaluate the readings of a cycle.

        Args:
            present: Readings of the servo.
            length: Length of its tendon beyond the zero, m; None without a zero.
            now_ns: Time, ns.
            pulls: Whether it should have torque.
        """
        self.missed, self._was_late = 0, False
        model = self._servo.known
        volts, degrees = present.voltage, present.temperature
        self._wrong_volts = 0 if model.least_v <= volts <= model.most_v else self._wrong_volts + 1
        if self._wrong_volts >= _BELIEVED_CYCLES:
            self._fail(f"has {volts:.1f} V, and needs {model.least_v:g} to {model.most_v:g} V")
        most_c = model.most_c - _MARGIN_C
        self._hot = self._hot + 1 if degrees > most_c else 0
        if self._hot >= _BELIEVED_CYCLES:
            self._fail(f"has {degrees:.0f} C, more than {most_c:g} C")
        if pulls:
            self._see_tendon(length, self._servo.lengthening(present.speed), now_ns)

    def audit(self, register: Register, value: int, *, pulls: bool, goal: int) -> None:
        """Evaluate a register that shows whether the servo still obeys.

        Args:
            register: The register.
            value: Its value.
            pulls: Whether the servo should have torque.
            goal: Goal that was last sent, in counts; see `ServoFamily.goal`.
        """
        family = self._bus.family
        if register == family.hardware_error and value:
            words = family.error_words(value)
            self._fail(f"has switched itself off: {words}. Only a reboot gives it torque again")
        elif register == family.mark and family.has_watchdog and value == TRIPPED:
            words = f"it received nothing for {self._bus.watchdog_ms} ms"
            self._fail(f"was stopped by its own watchdog: {words}")
        elif register == family.mark and value == 0:
            self.was_reset = True
            self._fail("has restarted, for example after a dip of its power, and lost its zero")
        elif register == family.torque_enable and pulls and value == 0:
            self._fail("has let go by itself")
        elif register == family.goal and pulls:
            self._refused = 0 if value == goal else self._refused + 1
            if self._refused >= _MAX_WRONG_GOALS:
                self._fail(f"has a goal of {value} counts, and was sent {goal}")

    def _see_tendon(self, length: float | None, lengthening: float, now_ns: int) -> None:
        """Detect a lost tendon by its length, m, and the rate of change of that, m/s."""
        if length is not None and length < _SHORTEST_M:
            words = f"it is wound in by {-1e3 * length:.0f} mm, further than the finger lets it"
            self._fail(f"has lost its tendon: {words}")
        no_load = self._servo.known.no_load_rad_per_s * self._servo.spool_radius_m
        if -lengthening < _SLACK_SHARE * no_load:
            self._slack_since_ns = None
        elif self._slack_since_ns is None:
            self._slack_since_ns = now_ns
        elif now_ns - self._slack_since_ns >= _SLACK_NS:
            words = f"it winds in at {-1e3 * lengthening:.0f} mm/s, as without any load"
            self._fail(f"has lost its tendon: {words}")

    def _fail(self, what: str) -> None:
        self.fault = self.fault or f"{self._servo.words} {what}."
